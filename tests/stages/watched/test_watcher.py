from __future__ import annotations

import re
from dataclasses import replace

import cv2
import numpy as np
import pytest
from stages.watched.drawn_site import SIZE_PX, camera, ground_map, site_picture
from tolerances import STANDING_REL

from standoff.core.camera import Camera
from standoff.core.finding import WorkerFinding
from standoff.core.types import (
    Detections,
    Frame,
    GroundMap,
    GroundPositions,
    ImageArray,
    NoGroundMap,
    Tracks,
    WatchedGround,
)
from standoff.core.watched_ground import (
    BEHIND_MACHINE,
    BLURRED,
    COLUMNS,
    NO_CONTRAST,
    NO_GROUND,
    NO_MAP,
    OUTSIDE_MAP,
    REASONS,
    ROWS,
    TOO_DARK,
    TOO_SMALL,
    UNSURE_MAP,
    WATCHED,
    cell_middles_px,
)
from standoff.stages.frames import frame_from_array
from standoff.stages.watched import GroundWatcher, WatchedParams
from standoff.stages.watched.ground_cells import ground_cells

EXCAVATOR = 1
FINDING = WorkerFinding((10.0, 20.0, 40.0), (0.0, 0.9, 1.0))
SEEDS = range(3)
NOTHING = Detections.empty()


def frame(gray: ImageArray, time_s: float = 0.0) -> Frame:
    return frame_from_array(cv2.cvtColor(gray, cv2.COLOR_GRAY2BGR), time_s=time_s)


def nobody() -> tuple[Tracks, GroundPositions]:
    return Tracks.empty(), GroundPositions.empty()


def machine(box_px: tuple[float, ...], xy_m: tuple[float, float], radius_m: float) -> tuple[Tracks, GroundPositions]:
    one = np.ones(1)
    tracks = Tracks(one.astype(np.int64), np.array([box_px]), one, np.array([EXCAVATOR]), one > 0, one)
    positions = GroundPositions(
        track_id=tracks.track_id,
        class_id=tracks.class_id,
        xy_m=np.array([xy_m]),
        velocity_mps=np.zeros((1, 2)),
        state_covariance=np.zeros((1, 4, 4)),
        map_factor_m=np.zeros((1, 2, 10)),
        predicted=one < 0,
        standing_s=one,
        radius_m=radius_m * one,
        valid=one > 0,
        reason=np.array([""], dtype=object),
    )
    return tracks, positions


def watched(gray: ImageArray, ground: GroundMap | NoGroundMap, watcher: GroundWatcher | None = None) -> WatchedGround:
    return (watcher or GroundWatcher(finding=FINDING)).update(frame(gray), NOTHING, ground, *nobody())


@pytest.mark.parametrize(("altitude_m", "pitch_deg"), [(12.0, 30.0), (25.0, 50.0), (40.0, 75.0)])
def test_a_worker_is_as_tall_as_the_camera_shows_him(altitude_m: float, pitch_deg: float) -> None:
    matrix, rotation, translation = camera(altitude_m, pitch_deg)
    ground = ground_map(altitude_m, pitch_deg, lens=Camera(*SIZE_PX, matrix, np.zeros(5)))
    cells = ground_cells(ground, SIZE_PX, 1.7)
    feet_m, _ = ground.to_ground(cell_middles_px(SIZE_PX)[cells.is_ground])
    # A body as deep as it is wide, as another library projects it.
    turns = np.linspace(0.0, 2.0 * np.pi, 16, endpoint=False)
    ring = 0.187 * np.column_stack([np.cos(turns), np.sin(turns), 0.0 * turns])
    outline = np.concatenate([ring, ring + np.array([0.0, 0.0, 1.7])])
    bodies_m = np.column_stack([feet_m, np.zeros(len(feet_m))])[:, None] + outline
    seen_px, _ = cv2.projectPoints(bodies_m.reshape(-1, 3), rotation, translation, matrix, np.zeros(5))
    bodies_px = seen_px.reshape(len(feet_m), -1, 2)
    along = bodies_px[:, 16:].mean(axis=1) - bodies_px[:, :16].mean(axis=1)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    tall_px = np.ptp(np.einsum("nij,nj->ni", bodies_px, along), axis=1)
    np.testing.assert_allclose(cells.height_px[cells.is_ground], tall_px, rtol=STANDING_REL)
    parallel = ground_cells(ground_map(altitude_m, pitch_deg), SIZE_PX, 1.7)
    middle = ROWS // 2 * COLUMNS + COLUMNS // 2
    assert parallel.height_px[middle] == pytest.approx(cells.height_px[middle], rel=STANDING_REL)


def test_what_is_above_the_horizon_is_no_ground() -> None:
    found = watched(site_picture(0), ground_map(pitch_deg=10.0))
    horizon_px = (SIZE_PX[1] - 1) / 2.0 - 1100.0 * np.tan(np.radians(10.0))
    above = cell_middles_px(SIZE_PX)[:, 1].reshape(ROWS, COLUMNS) < horizon_px
    np.testing.assert_array_equal(found.cells == NO_GROUND, above)


@pytest.mark.parametrize("seed", SEEDS)
def test_clear_ground_is_watched_where_workers_are_tall_enough_and_nowhere_else(seed: int) -> None:
    picture, shares = site_picture(seed), []
    for altitude_m in (12.0, 40.0, 60.0, 80.0, 110.0):
        ground = ground_map(altitude_m)
        found = watched(picture, ground)
        tall = ground_cells(ground, SIZE_PX, 1.7).height_px.reshape(ROWS, COLUMNS) >= 20.0
        np.testing.assert_array_equal(found.cells, np.where(tall, WATCHED, TOO_SMALL))
        assert np.isnan(found.found_share[~tall]).all() and (found.found_share[tall] >= 0.9).all()
        shares.append(found.share)
    assert shares[0] == 1.0 and shares[-1] == 0.0 and shares == sorted(shares, reverse=True)


def test_what_a_smaller_input_makes_of_a_worker_counts() -> None:
    half = WorkerFinding(FINDING.height_px, FINDING.share, input_size_px=(640, 360), measured=True)
    sliced = WorkerFinding(FINDING.height_px, FINDING.share, (640, 360), view_share=(0.5, 0.5), measured=True)
    ground = ground_map(40.0)
    whole, seen_half, seen_sliced = (
        watched(site_picture(1), ground, GroundWatcher(finding=one)) for one in (FINDING, half, sliced)
    )
    assert seen_half.share < whole.share
    np.testing.assert_array_equal(seen_sliced.cells, whole.cells)


@pytest.mark.parametrize("seed", SEEDS)
def test_a_picture_that_shows_nobody_watches_nothing_and_says_why(seed: int) -> None:
    clear, ground, rng = site_picture(seed), ground_map(), np.random.default_rng(seed)
    noisy = clear * 0.04 + rng.normal(0.0, 3.0, clear.shape)
    ruined = {
        BLURRED: cv2.GaussianBlur(clear, (0, 0), 6.0),
        NO_CONTRAST: (clear * 0.1 + 190.0).astype(np.uint8),
        TOO_DARK: np.clip(noisy, 0, 255).astype(np.uint8),
    }
    for reason, picture in ruined.items():
        found = watched(picture, ground)
        assert found.share < 0.05
        assert next(iter(found.unwatched)) == REASONS[reason]


def test_mud_on_the_lens_hides_what_is_behind_it_and_no_more() -> None:
    picture = site_picture(2)
    picture[360:600, 320:640] = 70
    found = watched(picture, ground_map())
    muddy = np.zeros((ROWS, COLUMNS), dtype=bool)
    muddy[10:14, 10:14] = True
    assert (found.cells[muddy] == NO_CONTRAST).all()
    assert (found.cells[~muddy] == WATCHED).mean() > 0.95


def test_ground_that_the_map_places_badly_or_not_at_all_is_not_watched() -> None:
    picture, size = site_picture(0), np.abs(ground_map().image_to_ground).ravel()
    shares = [
        watched(picture, ground_map(covariance=np.diag((error * size) ** 2))).share for error in (0.0, 0.01, 0.05, 0.5)
    ]
    assert shares[0] == 1.0 and shares[-1] == 0.0 and shares == sorted(shares, reverse=True)
    unsure = watched(picture, ground_map(covariance=np.diag((0.5 * size) ** 2)))
    assert next(iter(unsure.unwatched)) == REASONS[UNSURE_MAP]
    left_px = np.array([[-1.0, -1.0], [639.5, -1.0], [639.5, 720.0], [-1.0, 720.0]])
    np.testing.assert_array_equal(
        watched(picture, ground_map(valid_px=left_px)).cells,
        np.repeat([[WATCHED, OUTSIDE_MAP]], 16, axis=1).repeat(ROWS, axis=0),
    )


def test_without_a_map_nothing_is_watched() -> None:
    watcher = GroundWatcher(finding=FINDING)
    assert watched(site_picture(0), ground_map(), watcher).share == 1.0
    found = watched(site_picture(0), NoGroundMap("reference not found"), watcher)
    assert (found.cells == NO_MAP).all() and found.share == 0.0
    assert np.isnan(found.missed_share)


def test_what_a_machine_may_hide_is_not_watched() -> None:
    tracks, positions = machine((400.0, 200.0, 600.0, 400.0), (0.0, 20.0), 12.0)
    found = GroundWatcher(finding=FINDING).update(frame(site_picture(0)), NOTHING, ground_map(), tracks, positions)
    x, y = cell_middles_px(SIZE_PX).T.reshape(2, ROWS, COLUMNS)
    behind = (x > 400.0) & (x < 600.0) & (y > 200.0) & (y < 360.0)
    np.testing.assert_array_equal(found.cells == BEHIND_MACHINE, behind)


def test_how_much_of_the_circle_about_a_machine_is_watched() -> None:
    ground, watcher = ground_map(30.0, 60.0), GroundWatcher(finding=FINDING, worker_radius_m=0.0)
    middle_m, edge_m = ground.to_ground(np.array([[640.0, 360.0], [-0.5, 360.0]]))[0]
    for place_m, least, most in ((middle_m, 1.0, 1.0), (edge_m, 0.4, 0.6), (edge_m - [40.0, 0.0], 0.0, 0.0)):
        tracks, positions = machine((2000.0, 2000.0, 2001.0, 2001.0), tuple(place_m), 5.0)
        found = watcher.update(frame(site_picture(0)), NOTHING, ground, tracks, positions)
        assert least <= found.around[0] <= most


def test_a_picture_is_judged_anew_after_a_while() -> None:
    watcher = GroundWatcher(WatchedParams(judge_every_s=0.5), FINDING)
    ground, foggy = ground_map(), (site_picture(0) * 0.1 + 190.0).astype(np.uint8)
    shares = [
        watcher.update(frame(picture, time_s), NOTHING, ground, *nobody()).share
        for time_s, picture in ((0.0, site_picture(0)), (0.2, foggy), (0.4, foggy), (0.5, foggy))
    ]
    assert shares == [1.0, 1.0, 1.0, 0.0]


def test_what_would_make_ground_watched_is_said_of_what_was_measured() -> None:
    measured = replace(FINDING, measured=True)
    for finding, altitude_m, words in (
        (measured, 12.0, None),
        (measured, 110.0, r"about 1\d px tall .* 90 % .* from 20 px"),
        (FINDING, 110.0, "nobody measured"),
    ):
        watcher = GroundWatcher(finding=finding)
        for time_s in (0.0, 1.0):
            watcher.update(frame(site_picture(0), time_s), NOTHING, ground_map(altitude_m), *nobody())
        said = list(watcher.describe()["warnings"])
        assert len(said) == (words is not None) and all(re.search(str(words), one) for one in said)
        # A stream that had no map for most of the time has another trouble.
        for time_s in range(2, 9):
            watcher.update(frame(site_picture(0), float(time_s)), NOTHING, NoGroundMap("not found"), *nobody())
        assert [one for one in watcher.describe()["warnings"] if "most ground" in one] == []
