"""A finished run looked at again: what `standoff open` shows, asks and keeps."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from standoff.core.outputs import OUTPUTS
from standoff.service.loopback import OpenPages, serve_page
from standoff.service.page_files import page_folder
from standoff.service.pictures import FilmPictures
from standoff.service.review.app import ReviewPage, review_app
from standoff.service.review.film_of_run import film_of_run
from standoff.service.review.run import FinishedRun
from standoff.stages.frames import SourceParams

__all__ = ["ReviewPage", "open_review", "review_app", "serve_review"]


def open_review(folder: Path, film: Path | None, pages: OpenPages) -> ReviewPage:
    """Open the folder of a run, and its film where it is found.

    Args:
        folder: Of the run.
        film: Where its film is; None: looked for beside the run and where we are.
        pages: Which will show it.

    Raises:
        StandoffError: One of them cannot be used.
    """
    run = FinishedRun(folder)
    fps = ((run.record.get("settings") or {}).get("source") or {}).get("fps")
    path, why_not = film_of_run(folder, run.record.get("source") or {}, film, fps)
    annotated = folder / OUTPUTS["video"]
    if path is None and annotated.is_file():
        path = annotated
    pictures = None if path is None else FilmPictures(path, SourceParams(fps=fps))
    return ReviewPage(run, pictures, why_not, pages)


def serve_review(
    folder: Path, film: Path | None, port: int, tell: Callable[[str], None], *, opens_browser: bool
) -> None:
    """Show the page until it is closed.

    Args:
        folder: Of the run.
        film: Where its film is; None: looked for beside the run and where we are.
        port: On which; 0: any that is free.
        tell: Called with the address.
        opens_browser: Show it there, too.

    Raises:
        StandoffError: The page was not built, the port is taken, or the run or its film cannot be used.
    """
    pages = OpenPages()
    app = review_app(open_review(folder, film, pages), pages, page_folder())
    serve_page(app, pages, port, tell, opens_browser=opens_browser)
