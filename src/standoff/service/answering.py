"""What every page's application has: problems in words, news for open pages, and the page itself."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final, TypeAlias

from fastapi import FastAPI, Request
from fastapi.responses import FileResponse, JSONResponse, Response, StreamingResponse
from fastapi.staticfiles import StaticFiles
from pydantic import BaseModel, ConfigDict

from standoff import __version__
from standoff.core.errors import StandoffError
from standoff.service.loopback import OpenPages

Responses: TypeAlias = dict[int | str, dict[str, Any]]


class Told(BaseModel):
    """An answer, or a part of one: what has a default is always there when it is told."""

    model_config = ConfigDict(json_schema_serialization_defaults_required=True)


class Problem(Told):
    """What is wrong, as the command line says it."""

    expected: str
    found: str
    fix: str


JPEG: Final[Responses] = {200: {"content": {"image/jpeg": {}}}}
FILE: Final[Responses] = {200: {"content": {"application/octet-stream": {}}}, 404: {"description": "There is none."}}
PROBLEM: Final[Responses] = {422: {"model": Problem, "description": "What is asked for cannot be."}}


def answering(title: str, pages: OpenPages) -> FastAPI:
    """Return an application that answers nothing yet but what every page asks.

    Args:
        title: Of its contract.
        pages: Which it counts.
    """
    app = answering_only(title)

    async def events() -> StreamingResponse:
        """Tell the page when something has changed; while it listens, it is open."""
        return StreamingResponse(pages.events(), media_type="text/event-stream")

    app.get("/api/events", response_class=StreamingResponse)(events)
    return app


def answering_only(title: str) -> FastAPI:
    """Return an application that answers nothing yet.

    Args:
        title: Of its contract.
    """
    app = FastAPI(title=title, version=__version__, docs_url=None, redoc_url=None, openapi_url="/api/openapi.json")
    app.add_exception_handler(StandoffError, _problem)
    return app


def show_page(app: FastAPI, folder: Path, name: str) -> None:
    """Show one of the built pages at the root.

    Args:
        app: With all its answers: what comes later is not asked.
        folder: Of the built pages.
        name: Of the page.
    """
    app.get("/", include_in_schema=False)(lambda: FileResponse(folder / f"{name}.html"))
    app.mount("/assets", StaticFiles(directory=folder / "assets"))


def _problem(_request: Request, error: Exception) -> Response:
    assert isinstance(error, StandoffError)
    problem = Problem(expected=error.expected, found=error.found, fix=error.fix)
    return JSONResponse(problem.model_dump(), status_code=422)
