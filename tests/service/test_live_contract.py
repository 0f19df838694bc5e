"""Whatever is asked, no page's server fails: schemathesis asks what the contracts allow, and what they do not."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import hypothesis
import pytest
import schemathesis
from cli.conftest import write_site
from cli.test_cli import make_video
from cli.test_replay import monitor
from fastapi import FastAPI
from schemathesis.core.result import Ok
from service.browser import told
from service.demo_film import HEIGHT_M, SIDE_M

from standoff.config import settings_from
from standoff.service.loopback import OpenPages
from standoff.service.review import open_review, review_app
from standoff.service.setup import SetupPage, setup_app
from standoff.service.setup.draft import Draft, DraftFile, ReferenceDraft
from standoff.service.setup.film import Film
from standoff.service.setup.sight import Sight

pytestmark = pytest.mark.live
CASES = int(os.environ.get("CONTRACT_CASES", "30"))
"""Of each question; 600 make ten thousand in all."""
ENDLESS = "/api/events"
CORNERS_PX = [(60.0, 180.0), (150.0, 185.0), (140.0, 120.0), (70.0, 118.0)]


@pytest.fixture
def setup(tmp_path: Path) -> Iterator[FastAPI]:
    film, pages = Film(make_video(tmp_path / "site.mp4", 20), settings_from({}, "nothing")), OpenPages()
    known = Draft(reference=ReferenceDraft(lengths_m=[SIDE_M], height_m=HEIGHT_M, corners_px=CORNERS_PX))
    drafts = DraftFile(tmp_path / ".site.yaml.draft", known)
    page = SetupPage(film, Sight(film, {}, detects=False), drafts, tmp_path / "site.yaml", pages)
    yield setup_app(page, pages, None)
    page.close()


@pytest.fixture
def review(tmp_path: Path) -> FastAPI:
    run = monitor(make_video(tmp_path / "site.mp4", 20), write_site(tmp_path), tmp_path / "out")
    pages = OpenPages()
    return review_app(open_review(run, None, pages), pages, None)


@pytest.mark.parametrize("name", ["setup", "review"])
def test_no_question_makes_the_server_fail(name: str, request: pytest.FixtureRequest, tmp_path: Path) -> None:
    app: Any = request.getfixturevalue(name)
    contract = schemathesis.openapi.from_asgi("/api/openapi.json", app).exclude(path=ENDLESS)
    asked = 0

    for found in contract.get_all_operations():
        assert isinstance(found, Ok), found
        operation = found.ok()

        @hypothesis.settings(
            max_examples=CASES, derandomize=True, database=None, deadline=None,
            suppress_health_check=list(hypothesis.HealthCheck), phases=[hypothesis.Phase.generate],
        )  # fmt: skip
        @hypothesis.given(case=operation.as_strategy())
        def ask(case: Any) -> None:
            nonlocal asked
            asked += 1
            answer = case.call()
            assert answer.status_code < 500, f"{case.as_curl_command()}: {answer.text}"
            case.validate_response(answer, checks=[schemathesis.checks.not_a_server_error])

        ask()
    told(f"{asked} questions of {name}")
    assert asked >= CASES
    shutil.rmtree(tmp_path, ignore_errors=True)
