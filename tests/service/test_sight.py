"""What the page shows is what is there: metres from four clicks, how sure they are, and what is wrong."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from laws import seeds

pytest.importorskip("fastapi", reason="the page's server needs the extra `serve`")

from service.demo_film import CLICK_PX, DEMO, HEIGHT_M, SIDE_M

from standoff.config import load_settings
from standoff.core.homography import FloatArray
from standoff.core.pose import View
from standoff.core.types import GroundMap
from standoff.monitor import open_run
from standoff.service.setup.draft import Draft, PointDraft, ReferenceDraft, ZoneDraft
from standoff.service.setup.film import Film, snapped_px
from standoff.service.setup.sight import Sight
from standoff.service.setup.site_file import save_site


@pytest.fixture(scope="module")
def sight(film: Film) -> Iterator[Sight]:
    opened = Sight(film, {}, detects=False)
    yield opened
    opened.close()


def clicked(corners_px: FloatArray, seed: int, **more: Any) -> Draft:
    """A draft of somebody whose hand is off by CLICK_PX in each coordinate."""
    noisy_px = corners_px + np.random.default_rng(seed).normal(0.0, CLICK_PX, (4, 2))
    reference = ReferenceDraft(lengths_m=[SIDE_M], height_m=HEIGHT_M, corners_px=noisy_px.tolist())
    return Draft(reference=reference.model_copy(update=more))


@pytest.mark.parametrize("seed", seeds(3))
def test_four_clicks_two_pixels_off_give_lengths_to_two_per_cent(
    sight: Sight, view: View, corners_px: FloatArray, seed: int
) -> None:
    draft = clicked(corners_px, seed)
    middle_m = view.to_plane(corners_px.mean(axis=0)[None])[0]
    for turn in np.linspace(0.0, 2.0 * np.pi, 5)[:-1]:
        end_m = middle_m + 10.0 * np.array([np.cos(turn), np.sin(turn)])
        ends_px = view.project(np.column_stack([np.array([middle_m, end_m]), np.zeros(2)]))
        tape = sight.tape(0.0, draft, *(tuple(one) for one in ends_px.tolist()))
        assert tape.length_m is not None and tape.sigma_m is not None
        assert tape.length_m == pytest.approx(10.0, rel=0.02)
        assert abs(tape.length_m - 10.0) < 3.0 * tape.sigma_m


def test_corners_are_found_where_they_are_and_the_clicks_said_to_be_off(sight: Sight, corners_px: FloatArray) -> None:
    answer = sight.answer(0.0, clicked(corners_px, 4))
    assert answer.found and answer.off_px is not None and answer.off_px > 0.5
    away = np.linalg.norm(np.array(answer.corners_px)[:, None] - corners_px[None], axis=2).min(axis=0)
    assert away.max() < 1.0
    assert len(answer.solid_px) == 6  # the top, the foot, and four edges between


def test_places_grow_less_sure_away_from_the_reference(sight: Sight, corners_px: FloatArray) -> None:
    answer = sight.answer(0.0, clicked(corners_px, 5))
    middle_px = corners_px.mean(axis=0)
    away = {
        contour.sigma_m: min(np.linalg.norm(np.array(line) - middle_px, axis=1).min() for line in contour.lines_px)
        for contour in answer.contours
    }
    assert len(away) >= 3 and list(away.values()) == sorted(away.values())


def test_a_hand_snaps_to_the_corner(film: Film, corners_px: FloatArray) -> None:
    frame, rng = film.frame(0.0), np.random.default_rng(11)
    clicks_px = np.repeat(corners_px, 10, axis=0) + rng.normal(0.0, CLICK_PX, (40, 2))
    answers = [snapped_px(frame, (x, y)) for x, y in clicks_px.tolist()]
    snapped = np.array([one for _, one in answers])
    away_px = np.linalg.norm(np.array([at for at, _ in answers]) - np.repeat(corners_px, 10, axis=0), axis=1)
    assert snapped.mean() > 0.8 and np.median(away_px[snapped]) < 0.6
    for outside_px in ((0.0, 0.0), (-50.0, 3.0), (5000.0, 10.0)):
        assert snapped_px(frame, outside_px) == (outside_px, False)


def test_a_tape_that_was_read_wrong_by_half_shows_in_the_height_of_the_camera(
    sight: Sight, view: View, corners_px: FloatArray
) -> None:
    answer = sight.answer(0.0, clicked(corners_px, 6, lengths_m=[SIDE_M / 2]))
    height_m = float(answer.camera_height_text.removesuffix(" m"))
    assert height_m == pytest.approx(view.position_m[2] / 2, rel=0.05)


def test_corners_in_a_bow_tie_are_answered_in_words(sight: Sight, corners_px: FloatArray) -> None:
    answer = sight.answer(0.0, clicked(corners_px[[0, 2, 1, 3]], 6))
    assert not answer.found and "sides that cross" in answer.reason


def test_sides_that_no_quadrilateral_has_are_named(sight: Sight, corners_px: FloatArray) -> None:
    answer = sight.answer(0.0, clicked(corners_px, 7, shape="sides", lengths_m=[2.9, 2.9, 2.9, 2.9, 9.0]))
    assert not answer.found and "diagonal" in answer.reason


def test_four_surveyed_points_do_as_well(sight: Sight, view: View) -> None:
    places = view.to_plane(np.array([[300.0, 900.0], [1500.0, 950.0], [1300.0, 300.0], [500.0, 350.0]]))
    pixels = view.project(np.column_stack([places, np.zeros(4)]))
    draft = Draft(ground="survey")
    draft.survey.points = [
        PointDraft(name=f"p{k}", at_px=tuple(pixels[k].tolist()), m=tuple(places[k].tolist())) for k in range(4)
    ]
    found = sight.places(0.0, draft, [tuple(one) for one in pixels.tolist()])
    np.testing.assert_allclose(np.array(found), places, atol=0.15)
    assert sight.answer(0.0, draft).found


def test_zones_lie_where_they_were_drawn(sight: Sight, corners_px: FloatArray) -> None:
    draft = clicked(corners_px, 8)
    ring_px = [(500.0, 500.0), (900.0, 500.0), (900.0, 900.0), (500.0, 900.0)]
    ring_m = sight.places(0.0, draft, ring_px)
    draft.zones = [ZoneDraft(name="pit", kind="no_go", ring_m=[place for place in ring_m if place])]
    drawn_px = np.array(sight.answer(0.0, draft).zones_px[0])
    for corner in ring_px:
        assert np.linalg.norm(drawn_px - np.array(corner), axis=1).min() < 0.5


def test_the_plan_is_the_ground_from_above(sight: Sight, view: View, corners_px: FloatArray) -> None:
    draft = clicked(corners_px, 9)
    about = sight.answer(0.0, draft).plan
    picture = cv2.imdecode(np.frombuffer(sight.plan_jpeg(0.0, draft), np.uint8), cv2.IMREAD_COLOR)
    assert about is not None and picture is not None and picture.shape == (about.height_px, about.width_px, 3)
    scale = np.linalg.svd(np.array(about.to_plan)[:2, :2], compute_uv=False)
    np.testing.assert_allclose(scale, 1.0 / about.m_per_px, rtol=1e-6)


@pytest.mark.parametrize(("time_s", "clicked_s", "begins_s"), [(0.0, 0.0, 0.0), (5.0, 2.0, 2.0), (5.0, 6.0, 5.0)])
def test_a_trial_has_the_picture_that_was_clicked_in(
    sight: Sight, corners_px: FloatArray, time_s: float, clicked_s: float, begins_s: float
) -> None:
    settings = sight.part_to_try(clicked(corners_px, 11, time_s=clicked_s), time_s, 3.0)
    assert (settings.source.start_s, settings.source.stop_s) == (begins_s, time_s + 3.0)
    assert settings.ground.reference is not None and settings.ground.reference.box_time_s == clicked_s


@pytest.mark.parametrize("clicked_s", [0.0, 60.0])
def test_a_trial_far_from_that_picture_looks_for_the_reference_by_itself(
    sight: Sight, corners_px: FloatArray, clicked_s: float
) -> None:
    settings = sight.part_to_try(clicked(corners_px, 12, time_s=clicked_s), 20.0, 3.0)
    reference = settings.ground.reference
    assert reference is not None and reference.square_m == SIDE_M
    assert (reference.box_px, reference.box_time_s, reference.first_corner_px) == (None, None, None)
    assert (settings.source.start_s, settings.source.stop_s) == (20.0, 23.0)


def test_a_run_with_the_saved_site_measures_what_the_page_showed(
    sight: Sight, corners_px: FloatArray, site_file: Path
) -> None:
    draft = clicked(corners_px, 10)
    save_site(site_file, draft, sight.film.size_px)
    shown = sight.see(0.0, draft).ground
    nobody = {"factory": "standoff.testing:ScriptedDetector", "options": {"script": {}}}
    recorded = {"replace": {"detect": nobody}, "outputs": ["hazards"]}
    run = open_run(DEMO / "video.mp4", site_file.parent / "out", load_settings(site_file, recorded))
    first = next(iter(run)).ground
    assert isinstance(shown, GroundMap) and isinstance(first, GroundMap)
    np.testing.assert_allclose(first.image_to_ground, shown.image_to_ground, rtol=1e-9)
    np.testing.assert_allclose(first.covariance, shown.covariance, rtol=1e-6, atol=1e-15)
