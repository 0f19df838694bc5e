"""The questions and answers of the page of a finished run."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Any

from fastapi import FastAPI, HTTPException, Query
from fastapi.responses import FileResponse, Response

from standoff.clips.reviews import Review, add_review, read_reviews
from standoff.core.errors import ConfigError
from standoff.core.hazard_life import HazardLife
from standoff.core.outputs import ASSISTANCE
from standoff.service.answering import FILE, JPEG, PROBLEM, answering, show_page
from standoff.service.loopback import OpenPages
from standoff.service.pictures import FilmPictures
from standoff.service.review.answers import (
    CurvesAnswer,
    FramesAnswer,
    HazardAnswer,
    Party,
    ReviewChange,
    RunAnswer,
    ZoneAnswer,
)
from standoff.service.review.run import FinishedRun

_Time = Annotated[float, Query(ge=0, le=1e6, allow_inf_nan=False)]


class ReviewPage:
    """One finished run: its methods are the answers to the page's questions.

    Args:
        run: The run.
        film: Pictures of the film, or of the one that the run drew; None: neither is there.
        why_not: Why it is not the film itself; empty: it is.
        pages: Which show it.

    Raises:
        DataError: The reviews beside the run are broken.
    """

    def __init__(self, run: FinishedRun, film: FilmPictures | None, why_not: str, pages: OpenPages) -> None:
        self._run, self._film, self._why_not, self._pages = run, film, why_not, pages
        self._reviews = dict(read_reviews(run.folder))

    def run(self) -> RunAnswer:
        """Which run is it, and what came of it?"""
        run = self._run
        record: dict[str, Any] = dict(run.record)
        counts, ground = record.get("counts") or {}, record.get("watched_ground") or {}
        frames = counts.get("frames")
        width_px, height_px = run.size_px
        is_annotated = bool(self._why_not)
        return RunAnswer(
            name=str((record.get("source") or {}).get("name") or run.folder.resolve().name),
            status=str(record.get("status", "")),
            message=str(record.get("message") or ""),
            first_s=run.first_s,
            last_s=run.last_s,
            width_px=width_px,
            height_px=height_px,
            shows="none" if self._film is None else "annotated" if is_annotated else "film",
            is_video=self._film is not None and self._film.path.is_file(),
            film_starts_s=run.first_s if is_annotated else 0.0,
            why_not=self._why_not,
            unit=run.unit.symbol,
            metre=1.0 / run.unit.in_m,
            mapped_share=counts.get("frames_with_map", 0) / frames if frames else None,
            watched_share=ground.get("share"),
            warnings=[run.unit.said(str(one)) for one in record.get("warnings") or ()],
            missing=run.missing,
            zones=[
                ZoneAnswer(name=zone.name, kind=zone.kind, rings_m=[ring.tolist() for ring in zone.rings_m])
                for zone in run.zones()
            ],
            plan_m=run.bounds_m(),
            hazards=[self._hazard(life) for life in run.lives],
            assistance=ASSISTANCE,
        )

    def _hazard(self, life: HazardLife) -> HazardAnswer:
        unit, review = self._run.unit, self._reviews.get(life.hazard_id)
        parties = zip(life.names, life.track_ids, strict=True)
        return HazardAnswer(
            hazard_id=life.hazard_id,
            rule=life.rule,  # type: ignore[arg-type]  # pydantic refuses others
            severity=life.severity,
            parties=[Party(kind=kind, track_id=track_id) for kind, track_id in parties],
            zone=life.zone,
            opened_s=life.opened_s,
            closed_s=life.closed_s,
            worst_s=life.worst_s,
            distance_text=unit.distance(life.distance_m, life.sigma_m),
            gap_text=unit.length(life.gap_m),
            reason=unit.said(life.reason),
            verdict="open" if review is None else review.verdict,
            comment="" if review is None else review.comment,
        )

    def curves(self) -> CurvesAnswer:
        """What changed over the run?"""
        return self._run.curves()

    def frames(self, from_s: _Time, to_s: _Time) -> FramesAnswer:
        """What is there to draw in a short span?"""
        return FramesAnswer(frames=self._run.frames(from_s, to_s))

    def picture(self, time_s: _Time) -> Response:
        """Show the picture at a time of the run; `X-Time-S` says which it is."""
        if self._film is None:
            raise HTTPException(404, "There is none.")
        starts_s = self._run.first_s if self._why_not else 0.0
        jpeg, frame = self._film.jpeg(max(time_s - starts_s, 0.0))
        return Response(jpeg, media_type="image/jpeg", headers={"X-Time-S": f"{frame.time_s + starts_s:.6f}"})

    def film(self) -> FileResponse:
        """Show the film."""
        if self._film is None or not self._film.path.is_file():
            raise HTTPException(404, "There is none.")
        return FileResponse(self._film.path)

    def review(self, change: ReviewChange) -> HazardAnswer:
        """Keep what somebody says of a hazard."""
        life = next((life for life in self._run.lives if life.hazard_id == change.hazard_id), None)
        if life is None:
            raise ConfigError(expected="a hazard of this run", found=change.hazard_id, fix="load the page again")
        said = Review(change.hazard_id, change.verdict, life.worst_s, change.comment, datetime.now(UTC))
        add_review(self._run.folder, said)
        self._reviews[change.hazard_id] = said
        self._pages.version += 1
        return self._hazard(life)


def review_app(page: ReviewPage, pages: OpenPages, folder: Path | None) -> FastAPI:
    """Return the application: one path for each question, and the page itself.

    Args:
        page: What answers.
        pages: Which it counts.
        folder: Of the built pages; None: the answers alone.
    """
    app = answering("standoff open", pages)
    app.get("/api/run")(page.run)
    app.get("/api/curves", responses=PROBLEM)(page.curves)
    app.get("/api/frames", responses=PROBLEM)(page.frames)
    app.get("/api/picture", responses=JPEG | FILE | PROBLEM, response_class=Response)(page.picture)
    app.get("/api/film", responses=FILE, response_class=FileResponse)(page.film)
    app.put("/api/review", responses=PROBLEM)(page.review)
    if folder is not None:
        show_page(app, folder, "review")
    return app
