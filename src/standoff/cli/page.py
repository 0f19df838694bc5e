"""`standoff setup` and `standoff open`: pages on this machine."""

from __future__ import annotations

from collections.abc import Callable, Generator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer

_Port = Annotated[int, typer.Option(min=0, max=65535, help="On this machine; 0: any that is free.")]
_Browser = Annotated[bool, typer.Option("--browser/--no-browser", help="Open the page in a browser.")]


def setup(
    source: Annotated[Path, typer.Argument(help="Video file, or a folder of pictures.", show_default=False)],
    config: Annotated[
        Path, typer.Option(help="Settings file to write; what stands in it of other things stays.")
    ] = Path("site.yaml"),
    port: _Port = 0,
    browser: _Browser = True,
) -> None:
    """Set a site up on a page: click the reference, see metres and where they are sure, draw zones, save."""
    with _serving() as tell:
        from standoff.service.setup import serve_setup

        serve_setup(source, config, port, tell, opens_browser=browser)


def open_run(
    out: Annotated[Path, typer.Argument(help="Folder of a finished run.", show_default=False)],
    film: Annotated[
        Path | None, typer.Option(help="Its film. Absent: looked for beside the folder and where you are.")
    ] = None,
    port: _Port = 0,
    browser: _Browser = True,
) -> None:
    """Look at a finished run on a page: film, plan, curves, hazards; say which were false alarms."""
    with _serving() as tell:
        from standoff.service.review import serve_review

        serve_review(out, film, port, tell, opens_browser=browser)


@contextmanager
def _serving() -> Generator[Callable[[str], None], None, None]:
    """Give what is called with a page's address; without the packages that pages need, say so in one line."""
    from standoff.core.errors import MissingDependency

    try:
        yield lambda address: typer.echo(f"Open {address}\nCtrl-C, or closing the page, ends it.")
    except ImportError as error:
        raise MissingDependency(
            expected="the packages of the page", found=f"no {error.name}", fix="pip install 'standoff[serve]'"
        ) from error
