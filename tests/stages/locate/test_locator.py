from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from stages.locate.oblique_world import HEIGHT_M, SIZE_PX, ground_map, seen_px, space_px, standing, tracks_of
from tolerances import GEOMETRY_REL, GROUND_THROUGH_LENS_M

from standoff.core import homography
from standoff.core.classes import CLASSES
from standoff.core.homography import FloatArray
from standoff.core.types import GroundMap, NoGroundMap, Tracks
from standoff.stages.locate import LocateParams, Locator
from standoff.stages.locate.params import Anchor

GROUND_M = np.array([[0.0, 35.0], [-8.0, 28.0], [12.0, 45.0], [5.0, 60.0]])
LENS = np.array([-0.12, 0.03, 0.001, -0.0008, 0.0])
FEET = LocateParams(anchor="bottom_centre", relief_sigma_m=0.0)
"""Exact for boxes that stand on a point, whatever is in them, on level ground."""


def box_with_foot_at(x: float, y: float) -> FloatArray:
    return standing(np.array([[x, y]]))


def test_the_bottom_centre_stands_where_the_entity_does() -> None:
    positions = Locator(FEET).update(0.0, tracks_of(standing(seen_px(GROUND_M))), ground_map())
    assert positions.valid.all()
    assert (positions.reason == "").all()
    np.testing.assert_allclose(positions.xy_m, GROUND_M, rtol=GEOMETRY_REL, atol=GEOMETRY_REL)


def test_lens_distortion_is_removed_from_the_foot_point() -> None:
    tracks = tracks_of(standing(seen_px(GROUND_M, LENS)))
    positions = Locator(FEET).update(0.0, tracks, ground_map(distortion=LENS))
    np.testing.assert_allclose(positions.xy_m, GROUND_M, atol=GROUND_THROUGH_LENS_M)
    bare = Locator(FEET).update(0.0, tracks, ground_map())
    assert np.abs(bare.xy_m - GROUND_M).max() > 0.1


def test_the_box_centre_is_the_papers_anchor() -> None:
    centre_px = seen_px(GROUND_M)
    boxes = np.column_stack([centre_px - 15.0, centre_px + 15.0])
    positions = Locator(LocateParams(anchor="box_centre")).update(0.0, tracks_of(boxes), ground_map())
    np.testing.assert_allclose(positions.xy_m, GROUND_M, rtol=GEOMETRY_REL, atol=GEOMETRY_REL)


def test_no_tracks_give_no_positions() -> None:
    for ground in (ground_map(), ground_map(distortion=LENS), NoGroundMap("reference not found")):
        assert len(Locator().update(0.0, Tracks.empty(), ground)) == 0


def test_without_a_map_every_row_says_why() -> None:
    tracks = tracks_of(standing(seen_px(GROUND_M)))
    positions = Locator().update(0.0, tracks, NoGroundMap("reference not found"))
    assert not positions.valid.any()
    assert set(positions.reason) == {"no ground map: reference not found"}
    for column in (positions.xy_m, positions.velocity_mps, positions.covariance_m2, positions.map_factor_m):
        assert np.isnan(column).all()
    np.testing.assert_array_equal(positions.track_id, tracks.track_id)
    assert (positions.radius_m == 2.0).all()


@pytest.mark.parametrize(
    ("x", "y", "reason"),
    [
        (960.0, 1079.0, "cut off by the picture's edge"),
        (960.0, 1300.0, "cut off by the picture's edge"),
        (10.0, 600.0, "cut off by the picture's edge"),
        (1909.5, 600.0, "cut off by the picture's edge"),
        (960.0, 1060.0, ""),
        (960.0, 30.0, ""),
        (40.0, 600.0, ""),
    ],
)
def test_a_box_that_may_go_on_outside_the_picture_is_not_located(x: float, y: float, reason: str) -> None:
    position = Locator().update(0.0, tracks_of(box_with_foot_at(x, y)), ground_map())
    assert position.reason[0] == reason
    assert position.valid[0] == (reason == "")


def test_a_box_centre_moves_when_the_top_is_cut_off() -> None:
    boxes = np.array([[900.0, 0.0, 930.0, 60.0]])
    assert Locator().update(0.0, tracks_of(boxes), ground_map()).valid.all()
    by_centre = Locator(LocateParams(anchor="box_centre")).update(0.0, tracks_of(boxes), ground_map())
    assert by_centre.reason[0] == "cut off by the picture's edge"


def test_an_edge_within_its_own_error_of_the_picture_edge_may_be_cut_off() -> None:
    foot = np.array([[960.0, SIZE_PX[1] - 10.0]])
    small, large = standing(foot, height_px=50.0), standing(foot, height_px=400.0)
    assert Locator().update(0.0, tracks_of(small), ground_map()).valid.all()
    assert not Locator().update(0.0, tracks_of(large), ground_map()).valid.any()


HORIZON_PX = 200.0


def map_with_a_horizon(covariance: FloatArray | None = None) -> GroundMap:
    """Return a map whose horizon is picture row 200; its denominator grows by 0.001 a row."""
    matrix = np.array([[0.03, 0.0, -28.8], [0.0, 0.0, 30.0], [0.0, 0.001, -0.001 * HORIZON_PX]])
    return GroundMap(matrix, np.zeros((9, 9)) if covariance is None else covariance, SIZE_PX, "exact", 0.02)


@pytest.mark.parametrize(
    ("below_px", "reason"),
    [
        (-40.0, "beyond the horizon"),
        (0.0, "beyond the horizon"),
        (5.0, "too near the horizon"),
        (40.0, ""),
    ],
)
def test_a_foot_at_the_horizon_has_no_place(below_px: float, reason: str) -> None:
    tracks = tracks_of(box_with_foot_at(960.0, HORIZON_PX + below_px))
    position = Locator().update(0.0, tracks, map_with_a_horizon())
    assert position.reason[0] == reason
    assert np.isfinite(position.xy_m).all() == (reason == "")


def test_an_uncertain_map_moves_the_horizon() -> None:
    covariance = np.zeros((9, 9))
    covariance[8, 8] = 0.02**2
    tracks = tracks_of(box_with_foot_at(960.0, HORIZON_PX + 40.0))
    assert Locator().update(0.0, tracks, map_with_a_horizon()).valid.all()
    assert Locator().update(0.0, tracks, map_with_a_horizon(covariance)).reason[0] == "too near the horizon"


def test_outside_the_maps_polygon_nothing_is_located() -> None:
    polygon = np.array([[800.0, 400.0], [1200.0, 400.0], [1200.0, 800.0], [800.0, 800.0]])
    tracks = tracks_of(standing(np.array([[1000.0, 600.0], [1300.0, 600.0]])))
    positions = Locator().update(0.0, tracks, ground_map(valid_px=polygon))
    assert positions.reason.tolist() == ["", "outside the ground map"]


def test_a_point_that_the_lens_model_cannot_explain_is_not_located() -> None:
    folded = np.array([-0.9, 0.0, 0.0, 0.0, 0.0])
    tracks = tracks_of(standing(np.array([[960.0, 600.0], [1860.0, 1040.0]])))
    positions = Locator().update(0.0, tracks, ground_map(distortion=folded))
    assert positions.reason.tolist() == ["", "outside the lens model"]


def test_the_covariance_is_the_boxes_share_and_the_maps() -> None:
    rng = np.random.default_rng(5)
    spread = rng.normal(size=(9, 8)) * 1e-7
    ground = ground_map(covariance=spread @ spread.T)
    tracks = tracks_of(standing(seen_px(GROUND_M)))
    with_map = Locator().update(0.0, tracks, ground)
    without = Locator().update(0.0, tracks, ground_map())
    share = with_map.map_factor_m @ with_map.map_factor_m.transpose(0, 2, 1)
    np.testing.assert_allclose(with_map.covariance_m2, without.covariance_m2 + share, rtol=GEOMETRY_REL)
    assert (np.linalg.eigvalsh(share) > 0).all()
    assert (without.map_factor_m == 0).all()


@pytest.mark.parametrize(("anchor", "up_px", "vertical_edges"), [("bottom_centre", 0.0, 1), ("box_centre", 25.0, 2)])
def test_an_anchor_between_two_edges_has_half_the_variance_of_one(
    anchor: Anchor, up_px: float, vertical_edges: int
) -> None:
    boxes = standing(seen_px(GROUND_M), width_px=40.0, height_px=50.0)
    params = LocateParams(anchor=anchor, relief_sigma_m=0.0)
    found = Locator(params).update(0.0, tracks_of(boxes), ground_map()).covariance_m2
    points_px = seen_px(GROUND_M) - np.array([0.0, up_px])
    jacobian = homography.point_jacobian(ground_map().image_to_ground, points_px)
    variance_px2 = np.array([(0.06 * 40.0) ** 2 / 2.0, (0.06 * 50.0) ** 2 / vertical_edges])
    expected = np.einsum("nij,j,nkj->nik", jacobian, variance_px2, jacobian)
    np.testing.assert_allclose(found, expected, rtol=GEOMETRY_REL, atol=GEOMETRY_REL)


def test_a_small_box_is_no_surer_than_a_pixel() -> None:
    boxes = standing(seen_px(GROUND_M), width_px=4.0, height_px=10.0)
    smaller = standing(seen_px(GROUND_M), width_px=2.0, height_px=5.0)
    first, second = (Locator(FEET).update(0.0, tracks_of(b), ground_map()).covariance_m2 for b in (boxes, smaller))
    np.testing.assert_array_equal(first, second)


def test_each_map_has_its_own_share() -> None:
    tracks = tracks_of(standing(seen_px(GROUND_M)))
    covariance = np.diag(np.full(9, 1e-14))
    locator = Locator()
    once, doubled = (
        locator.update(0.1 * i, tracks, ground_map(covariance=covariance * scale)).map_factor_m
        for i, scale in enumerate((1.0, 4.0))
    )
    np.testing.assert_allclose(doubled, 2.0 * once, rtol=GEOMETRY_REL)
    assert np.abs(once).max() > 0


def test_a_place_that_is_not_seen_is_predicted_less_and_less_surely_and_then_unknown() -> None:
    boxes = standing(seen_px(GROUND_M[:1]))
    locator, ground = Locator(), ground_map()
    first = locator.update(0.0, tracks_of(boxes), ground)
    spread_m2 = [first.covariance_m2[0]]
    for time_s in (0.2, 0.4, 1.0):
        later = locator.update(time_s, tracks_of(boxes, observed=[False]), ground)
        assert later.valid.all() and later.predicted.all()
        np.testing.assert_allclose(later.xy_m, first.xy_m, atol=GEOMETRY_REL)
        spread_m2.append(later.covariance_m2[0])
    assert all((np.linalg.eigvalsh(b - a) > 0).all() for a, b in pairwise(spread_m2))
    gone = locator.update(1.2, tracks_of(boxes, observed=[False]), ground)
    assert gone.reason.tolist() == ["not seen any more"]
    again = locator.update(1.4, tracks_of(boxes), ground)
    assert again.valid.all() and not again.predicted.any()
    assert (np.linalg.eigvalsh(spread_m2[-1] - again.covariance_m2[0]) > 0).all()


def test_what_the_edge_cuts_off_is_predicted_from_where_it_was_whole() -> None:
    locator, ground = Locator(FEET), ground_map()
    for step in range(12):
        tracks = tracks_of(box_with_foot_at(960.0, 1062.0))
        locator.update(0.1 * step, tracks, ground)
    whole = locator.update(1.2, tracks, ground)
    cut = locator.update(1.3, tracks_of(box_with_foot_at(960.0, 1079.0)), ground)
    assert cut.valid.all() and cut.predicted.all()
    assert np.linalg.norm(cut.xy_m - whole.xy_m) < 0.1
    assert (np.linalg.eigvalsh(cut.covariance_m2[0] - whole.covariance_m2[0]) > 0).all()
    late = locator.update(2.4, tracks_of(box_with_foot_at(960.0, 1079.0)), ground)
    assert late.reason.tolist() == ["cut off by the picture's edge"]


def test_what_was_cut_off_just_before_is_so_still() -> None:
    """Loose boxes leave the edge for a frame, and what stands there is elsewhere all the same."""
    locator, ground = Locator(FEET), ground_map()
    edge, inside = box_with_foot_at(960.0, 1079.0), box_with_foot_at(960.0, 1060.0)
    told = []
    for step, box in enumerate([edge, inside, edge, inside, inside, inside, inside, inside]):
        told.append(bool(locator.update(0.1 * step, tracks_of(box), ground).valid[0]))
    assert told == [False] * 5 + [True] * 3


def test_ground_of_unknown_height_makes_a_place_unsure_along_the_view_only() -> None:
    tracks, height_m = tracks_of(standing(seen_px(GROUND_M))), 0.5
    level, rough = (
        Locator(LocateParams(anchor="bottom_centre", relief_sigma_m=sigma_m)).update(0.0, tracks, ground_map())
        for sigma_m in (0.0, height_m)
    )
    gained_m2 = rough.covariance_m2 - level.covariance_m2
    along = GROUND_M / np.linalg.norm(GROUND_M, axis=1, keepdims=True)
    # Ground that is higher by h hides what lies h over the height of the camera further away.
    shift_m = np.linalg.norm(GROUND_M, axis=1) / HEIGHT_M * height_m
    expected = np.einsum("n,ni,nj->nij", shift_m**2, along, along)
    assert np.abs(GROUND_M[0, 0]) == 0.0  # in the middle of the picture, where it is exact
    np.testing.assert_allclose(gained_m2[0], expected[0], rtol=1e-3)
    sizes = np.sqrt(np.linalg.eigvalsh(gained_m2)[:, 1] / shift_m**2)
    assert (np.abs(sizes - 1.0) < 1 / 6).all()
    aligned = np.einsum("nij,ni,nj->n", gained_m2, along, along) / np.trace(gained_m2, axis1=1, axis2=2)
    assert (aligned > 0.98).all()


def test_off_smoothing_each_frame_stands_for_itself() -> None:
    rng = np.random.default_rng(3)
    locator = Locator(LocateParams(anchor="bottom_centre", smooth=False))
    for step in range(5):
        places_m = GROUND_M + rng.normal(size=GROUND_M.shape)
        positions = locator.update(0.1 * step, tracks_of(standing(seen_px(places_m))), ground_map())
        np.testing.assert_allclose(positions.xy_m, places_m, rtol=GEOMETRY_REL, atol=GEOMETRY_REL)


def test_action_radii_come_from_the_class_then_the_settings_then_the_track() -> None:
    params = LocateParams(radius_m={"excavator": 9.0}, track_radius_m={3: 20.0})
    tracks = tracks_of(standing(seen_px(GROUND_M)), class_id=[0, 1, 1, 2])
    assert Locator(params).update(0.0, tracks, ground_map()).radius_m.tolist() == [2.0, 9.0, 20.0, 5.8]


def test_wrong_settings_are_named() -> None:
    with pytest.raises(ValueError, match=r"no class is called crane; there are worker, excavator") as error:
        LocateParams(radius_m={"crane": 3.0})
    assert all(site_class.name in str(error.value) for site_class in CLASSES)
    with pytest.raises(ValueError, match="action radius of worker must be a number of metres from 0, not -1"):
        LocateParams(radius_m={"worker": -1.0})
    with pytest.raises(ValueError, match="action radius of 7 must be a number of metres from 0, not nan"):
        LocateParams(track_radius_m={7: float("nan")})


def test_velocity_comes_from_observed_positions_and_is_unknown_where_invalid() -> None:
    locator = Locator(FEET)
    for step in range(31):
        walked = GROUND_M[:1] + np.array([[1.4, 0.0]]) * (0.1 * step)
        positions = locator.update(0.1 * step, tracks_of(standing(seen_px(walked))), ground_map())
        assert step > 0 or np.isnan(positions.velocity_mps).all()
    np.testing.assert_allclose(positions.velocity_mps, [[1.4, 0.0]], atol=0.1)
    np.testing.assert_allclose(positions.xy_m, walked, atol=0.1)
    elsewhere = tracks_of(standing(seen_px(GROUND_M[1:2])), observed=[False])
    np.testing.assert_allclose(locator.update(3.1, elsewhere, ground_map()).velocity_mps, [[1.4, 0.0]], atol=0.2)
    unmapped = locator.update(3.2, tracks_of(standing(seen_px(GROUND_M[:1]))), NoGroundMap("stale"))
    assert np.isnan(unmapped.velocity_mps).all()


def test_a_reset_forgets_and_leaves_other_streams_alone() -> None:
    first, second = Locator(), Locator()
    for step in range(16):
        for locator in (first, second):
            locator.update(0.1 * step, tracks_of(standing(seen_px(GROUND_M[:1]))), ground_map())
    first.reset()
    tracks = tracks_of(standing(seen_px(GROUND_M[:1])))
    assert np.isnan(first.update(1.6, tracks, ground_map()).velocity_mps).all()
    assert np.isfinite(second.update(1.6, tracks, ground_map()).velocity_mps).all()


def _pointed(boxes: FloatArray, foot_px: FloatArray, sigma_px: float) -> Tracks:
    covariance_px2 = np.tile(sigma_px**2 * np.eye(2), (len(boxes), 1, 1))
    return replace(tracks_of(boxes), foot_px=foot_px, foot_covariance_px2=covariance_px2)


@pytest.mark.parametrize("lens", [None, LENS])
def test_a_ground_point_goes_before_every_point_of_the_box_also_where_the_picture_cuts_it(
    lens: FloatArray | None,
) -> None:
    foot_px = seen_px(GROUND_M, lens)
    boxes = np.column_stack([foot_px - 90.0, foot_px + np.array([40.0, 30.0])])
    boxes[0, 0] = -0.5
    ground = ground_map(distortion=lens)
    positions = Locator().update(0.0, _pointed(boxes, foot_px, 1.0), ground)
    assert positions.valid.all()
    np.testing.assert_allclose(positions.xy_m, GROUND_M, atol=GROUND_THROUGH_LENS_M)
    for anchor in ("bottom_centre", "box_centre"):
        by_box = Locator(LocateParams(anchor=anchor)).update(0.0, _pointed(boxes, foot_px, 1.0), ground)
        assert np.abs(by_box.xy_m - GROUND_M)[by_box.valid].min() > 0.05
    level = LocateParams(relief_sigma_m=0.0)
    sure, wider = (Locator(level).update(0.0, _pointed(boxes, foot_px, sigma), ground) for sigma in (1.0, 3.0))
    np.testing.assert_allclose(wider.covariance_m2, 9.0 * sure.covariance_m2, rtol=1e-6)


def test_tracks_without_a_ground_point_stand_where_their_boxes_do() -> None:
    boxes = standing(seen_px(GROUND_M))
    some = _pointed(boxes, seen_px(GROUND_M) + 5.0, 1.0)
    foot_px, covariance_px2 = some.foot_px.copy(), some.foot_covariance_px2.copy()
    foot_px[1], covariance_px2[1] = np.nan, np.nan
    mixed = Locator().update(0.0, replace(some, foot_px=foot_px, foot_covariance_px2=covariance_px2), ground_map())
    plain = Locator().update(0.0, tracks_of(boxes), ground_map())
    assert np.isclose(mixed.xy_m, plain.xy_m).all(axis=1).tolist() == [row == 1 for row in range(len(boxes))]
    np.testing.assert_allclose(mixed.covariance_m2[1], plain.covariance_m2[1])


def test_a_class_prior_finds_a_solid_block_from_any_side_and_admits_what_a_box_cannot_tell() -> None:
    """A block as deep across the view as along it, so tall as the prior has it for a dump truck."""
    deep_m, high_m = 5.0, 2.0
    corners_m = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (0, 1)]) * [
        deep_m / 2,
        deep_m / 2,
        high_m,
    ]
    boxes = []
    for x_m, y_m in GROUND_M:
        seen = space_px(corners_m + np.array([x_m, y_m, 0.0]))
        boxes.append([*seen.min(axis=0), *seen.max(axis=0)])
    truck = [3] * len(GROUND_M)
    tracks = tracks_of(np.array(boxes), class_id=truck)
    by_prior = Locator(LocateParams()).update(0.0, tracks, ground_map())
    by_bottom = Locator(LocateParams(anchor="bottom_centre")).update(0.0, tracks, ground_map())
    off_m = np.linalg.norm(by_prior.xy_m - GROUND_M, axis=1)
    assert (off_m < 0.5).all() and (off_m < 0.25 * np.linalg.norm(by_bottom.xy_m - GROUND_M, axis=1)).all()
    assert (np.linalg.eigvalsh(by_prior.covariance_m2)[:, 0] >= 0.6**2).all()


def test_a_class_prior_yields_to_the_detectors_own_point_and_leaves_people_at_their_feet() -> None:
    boxes = standing(seen_px(GROUND_M))
    prior = Locator(LocateParams())
    own = prior.update(0.0, _pointed(boxes, seen_px(GROUND_M), 1.0), ground_map())
    np.testing.assert_allclose(own.xy_m, GROUND_M, rtol=GEOMETRY_REL, atol=GEOMETRY_REL)
    people = prior.update(0.0, tracks_of(boxes), ground_map())
    assert (np.linalg.norm(people.xy_m - GROUND_M, axis=1) < 0.35).all()
