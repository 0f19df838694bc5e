"""`standoff setup`: a page on this machine on which a site is set up by looking at it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def setup(
    source: Annotated[Path, typer.Argument(help="Video file, or a folder of pictures.", show_default=False)],
    config: Annotated[
        Path, typer.Option(help="Settings file to write; what stands in it of other things stays.")
    ] = Path("site.yaml"),
    port: Annotated[int, typer.Option(min=0, max=65535, help="On this machine; 0: any that is free.")] = 0,
    browser: Annotated[bool, typer.Option("--browser/--no-browser", help="Open the page in a browser.")] = True,
) -> None:
    """Set a site up on a page: click the reference, see metres and where they are sure, draw zones, save."""
    from standoff.core.errors import MissingDependency

    try:
        from standoff.service.setup import serve_setup
    except ImportError as error:
        raise MissingDependency(
            expected="the packages of the page", found=f"no {error.name}", fix="pip install 'standoff[serve]'"
        ) from error
    serve_setup(
        source, config, port, lambda address: typer.echo(f"Open {address}\nCtrl-C, or closing the page, ends it."),
        opens_browser=browser,
    )  # fmt: skip
