"""Templates of pages for people, as every page of standoff has them."""

from __future__ import annotations

from collections.abc import Callable
from importlib.resources import files

import jinja2


def page_template(package: str, name: str, **filters: Callable[..., object]) -> jinja2.Template:
    """Return a template that escapes whatever is put into it, and in which nothing may be missing.

    Args:
        package: In whose folder it lies.
        name: Of its file.
        filters: By the names that it gives them.
    """
    environment = jinja2.Environment(autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True)
    environment.filters.update(filters)
    return environment.from_string((files(package) / name).read_text(encoding="utf-8"))
