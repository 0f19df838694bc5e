"""The answers of the status page."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Final

from fastapi import FastAPI
from fastapi import Path as InPath
from fastapi.responses import Response

from standoff.service.answering import JPEG, answering_only, show_page
from standoff.service.status.answers import HealthAnswer, StatusAnswer
from standoff.service.status.metrics import metrics_text
from standoff.service.status.overview import Overview

OPEN_PATHS: Final = frozenset({"/healthz", "/metrics"})
"""What programs on this machine may ask without the page's secret: numbers and names, no picture."""

_METRICS_TYPE: Final = "text/plain; version=1.0.0; charset=utf-8"

StreamName = Annotated[str, InPath(max_length=64, pattern=r"^[A-Za-z0-9][A-Za-z0-9_-]*$")]


def status_app(overview: Overview, pages: Path | None) -> FastAPI:
    """Return the application.

    Args:
        overview: Knows.
        pages: Folder of the built pages; None: answers only.
    """
    app = answering_only("standoff: status of a live site")

    def status() -> StatusAnswer:
        """Tell all of the site at this moment."""
        return overview.status()

    def picture(stream: StreamName) -> Response:
        """Show a stream's newest picture."""
        found = overview.picture(stream)
        if found is None:
            return Response(status_code=404)
        return Response(found[0], media_type="image/jpeg", headers={"X-Age-Ms": f"{found[1] * 1e3:.0f}"})

    def healthz(response: Response) -> HealthAnswer:
        """Tell whether the service works: 503 where a process or the broker does not answer."""
        health = overview.health()
        response.status_code = 503 if health.overall == "failing" else 200
        return health

    def metrics() -> Response:
        """Tell the numbers, for Prometheus."""
        return Response(metrics_text(overview.status()), media_type=_METRICS_TYPE)

    app.get("/api/status")(status)
    app.get(
        "/api/streams/{stream}/picture",
        response_class=Response,
        responses={**JPEG, 404: {"description": "There is none."}},
    )(picture)
    app.get("/healthz", responses={503: {"model": HealthAnswer, "description": "It does not work."}})(healthz)
    app.get("/metrics", response_class=Response, responses={200: {"content": {"text/plain": {}}}})(metrics)
    if pages is not None:
        show_page(app, pages, "status")
    return app
