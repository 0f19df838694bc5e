"""The set-up page's questions and answers."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated, Final

from fastapi import FastAPI, HTTPException, Query, Request
from fastapi.responses import FileResponse, JSONResponse, Response

from standoff.core.lengths import UNITS
from standoff.service.answering import FILE, JPEG, PROBLEM, Responses, answering, show_page
from standoff.service.loopback import OpenPages
from standoff.service.setup.answers import (
    DraftAnswer,
    DraftChange,
    FilmAnswer,
    GroundAnswer,
    GroundQuestion,
    LengthAnswer,
    LengthQuestion,
    PlacesAnswer,
    PlacesQuestion,
    PointAnswer,
    PointQuestion,
    RevisionAnswer,
    SaveAnswer,
    SaveQuestion,
    TapeAnswer,
    TapeQuestion,
    TrialAnswer,
    TrialQuestion,
)
from standoff.service.setup.draft import DraftFile, DraftStale, read_length_m, usual_radius_m
from standoff.service.setup.film import Film, snapped_px
from standoff.service.setup.sight import Sight
from standoff.service.setup.site_file import save_site
from standoff.service.setup.trial import SHOWN, Trial

_STALE: Final[Responses] = {409: {"model": RevisionAnswer, "description": "Another page has changed the draft."}}

_Time = Annotated[float, Query(ge=0, le=1e6, allow_inf_nan=False)]


class SetupPage:
    """One film that is set up: its methods are the answers to the page's questions.

    Args:
        film: The film.
        sight: What a draft says of it.
        drafts: The draft on disk.
        site_file: Where the settings will be.
        pages: Which show it.
    """

    def __init__(self, film: Film, sight: Sight, drafts: DraftFile, site_file: Path, pages: OpenPages) -> None:
        self._film, self._sight, self._drafts, self._site_file, self._pages = film, sight, drafts, site_file, pages
        self._trial = Trial(film.path, self._changed)

    def _changed(self) -> None:
        self._pages.version += 1

    def close(self) -> None:
        """End what goes on, and remove what is of no use any more."""
        self._trial.close()
        self._sight.close()

    def film(self) -> FilmAnswer:
        """Which film is it?"""
        about, (width_px, height_px) = self._film.about, self._film.size_px
        telemetry = about.get("telemetry") or {}
        return FilmAnswer(
            name=str(about.get("name", self._film.path.name)),
            width_px=width_px,
            height_px=height_px,
            first_s=self._film.first_s,
            last_s=self._film.last_s,
            fps=about.get("fps"),
            telemetry=str(telemetry.get("log") or telemetry.get("kind") or ""),
        )

    def picture(self, time_s: _Time) -> Response:
        """Show the picture at a time; `X-Time-S` says which it is."""
        jpeg, frame = self._film.jpeg(time_s)
        return Response(jpeg, media_type="image/jpeg", headers={"X-Time-S": f"{frame.time_s:.6f}"})

    def draft(self) -> DraftAnswer:
        """How far is the draft?"""
        return DraftAnswer(
            revision=self._drafts.revision,
            draft=self._drafts.draft,
            site_file=str(self._site_file),
            usual_radius_m=usual_radius_m(),
        )

    def keep(self, change: DraftChange) -> RevisionAnswer:
        """Keep a new draft."""
        revision = self._drafts.replace(change.draft, change.revision)
        self._changed()
        return RevisionAnswer(revision=revision)

    def corner(self, question: PointQuestion) -> PointAnswer:
        """Which corner of edges is near a point?"""
        at_px, snapped = snapped_px(self._film.frame(question.time_s), question.at_px)
        return PointAnswer(at_px=at_px, snapped=snapped)

    def ground(self, question: GroundQuestion) -> GroundAnswer:
        """What does a draft say of the ground in the picture at a time?"""
        return self._sight.answer(question.time_s, question.draft, is_dragging=question.is_dragging)

    def plan(self, question: GroundQuestion) -> Response:
        """Show the ground from above, as the answer to `ground` describes it."""
        return Response(self._sight.plan_jpeg(question.time_s, question.draft), media_type="image/jpeg")

    def length(self, question: LengthQuestion) -> LengthAnswer:
        """Which length does somebody mean?"""
        length_m = question.length_m if question.length_m is not None else read_length_m(question.text, question.unit)
        return LengthAnswer(length_m=length_m, text=UNITS[question.unit].limit(length_m))

    def tape(self, question: TapeQuestion) -> TapeAnswer:
        """How far is it between two points of the picture?"""
        return self._sight.tape(question.time_s, question.draft, question.from_px, question.to_px)

    def places(self, question: PlacesQuestion) -> PlacesAnswer:
        """Where on the ground are points of the picture?"""
        return PlacesAnswer(at_m=self._sight.places(question.time_s, question.draft, question.at_px))

    def trial(self) -> TrialAnswer:
        """How does the trial go?"""
        return self._trial.answer

    def begin_trial(self, question: TrialQuestion) -> TrialAnswer:
        """Run some seconds."""
        return self._trial.begin(self._sight.part_to_try(question.draft, question.time_s, question.lasts_s))

    def stop_trial(self) -> TrialAnswer:
        """Let the trial be."""
        self._trial.stop()
        return self._trial.answer

    def of_trial(self, number: int, name: str) -> FileResponse:
        """Show what a trial wrote."""
        path = self._trial.file(name, number) if name in SHOWN else None
        if path is None:
            raise HTTPException(404, "There is none.")
        return FileResponse(path)

    def save(self, question: SaveQuestion) -> SaveAnswer:
        """Write the settings."""
        self._sight.settings(question.draft)
        written = save_site(self._site_file, question.draft, self._film.size_px)
        self._drafts.remove()
        return SaveAnswer(
            files=[str(path) for path in written],
            command=shlex.join(
                ["standoff", "run", str(self._film.path), "--config", str(self._site_file), "--out", "out"]
            ),
        )


def setup_app(page: SetupPage, pages: OpenPages, folder: Path | None) -> FastAPI:
    """Return the application: one path for each question, and the page itself.

    Args:
        page: What answers.
        pages: Which it counts.
        folder: Of the built page; None: the answers alone.
    """
    app = answering("standoff setup", pages)
    app.add_exception_handler(DraftStale, _stale)
    app.get("/api/film")(page.film)
    app.get("/api/picture", responses=JPEG | PROBLEM, response_class=Response)(page.picture)
    app.get("/api/draft")(page.draft)
    app.put("/api/draft", responses=_STALE | PROBLEM)(page.keep)
    app.post("/api/corner", responses=PROBLEM)(page.corner)
    app.post("/api/ground", responses=PROBLEM)(page.ground)
    app.post("/api/plan", responses=JPEG | PROBLEM, response_class=Response)(page.plan)
    app.post("/api/length", responses=PROBLEM)(page.length)
    app.post("/api/tape", responses=PROBLEM)(page.tape)
    app.post("/api/places", responses=PROBLEM)(page.places)
    app.get("/api/trial")(page.trial)
    app.post("/api/trial", responses=PROBLEM)(page.begin_trial)
    app.delete("/api/trial")(page.stop_trial)
    app.get("/api/trial/{number}/{name}", responses=FILE, response_class=FileResponse)(page.of_trial)
    app.post("/api/save", responses=PROBLEM)(page.save)
    if folder is not None:
        show_page(app, folder, "setup")
    return app


def _stale(_request: Request, error: Exception) -> Response:
    assert isinstance(error, DraftStale)
    return JSONResponse(RevisionAnswer(revision=error.revision).model_dump(), status_code=409)
