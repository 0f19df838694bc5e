from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

from standoff.core.camera import Camera
from standoff.core.types import Detections, GroundMap, GroundPositions, NoGroundMap, Proximities, Tracks

_ROWS: dict[type[Any], dict[str, Any]] = {
    Detections: {"xyxy_px": [[0, 1, 2, 3], [4, 5, 6, 7]], "score": [0.5, 0.9], "class_id": [0, 1]},
    Tracks: {
        "track_id": [1, 2],
        "xyxy_px": [[0, 1, 2, 3], [4, 5, 6, 7]],
        "score": [0.5, 0.9],
        "class_id": [0, 1],
        "observed": [True, False],
        "age_s": [0.0, 1.0],
    },
    GroundPositions: {
        "track_id": [1, 2],
        "class_id": [0, 1],
        "xy_m": [[1.0, 2.0], [np.nan, np.nan]],
        "velocity_mps": np.zeros((2, 2)),
        "state_covariance": np.zeros((2, 4, 4)),
        "map_factor_m": np.zeros((2, 2, 10)),
        "predicted": [False, False],
        "standing_s": [0.0, np.nan],
        "radius_m": [2.0, 12.1],
        "valid": [True, False],
        "reason": ["", "beyond the horizon"],
    },
    Proximities: {
        "track_a": [1, 1],
        "track_b": [2, 3],
        "distance_m": [5.0, np.nan],
        "gap_m": [1.0, np.nan],
        "sigma_m": [0.1, np.nan],
        "closing_mps": [0.0, np.nan],
        "time_to_contact_s": [np.inf, np.nan],
        "filtered": [False, False],
    },
}
_TYPES = sorted(_ROWS, key=lambda rows_type: rows_type.__name__)


def ground_map(**changes: Any) -> GroundMap:
    return GroundMap(**{**_GROUND_MAP, **changes})


_GROUND_MAP: dict[str, Any] = {
    "image_to_ground": np.diag([0.1, -0.1, 1.0]),
    "covariance": np.zeros((9, 9)),
    "image_size_px": (640, 480),
    "method": "test",
    "scale_m_per_px": 0.1,
}


@pytest.mark.parametrize("rows_type", _TYPES)
def test_columns_are_copied_and_read_only(rows_type: type[Any]) -> None:
    columns = {name: np.array(value) for name, value in _ROWS[rows_type].items()}
    rows = rows_type(**columns)
    for name, given in columns.items():
        kept = getattr(rows, name)
        assert not np.shares_memory(kept, given)
        with pytest.raises(ValueError, match="read-only"):
            kept[0] = given[1]
        with pytest.raises(dataclasses.FrozenInstanceError):
            setattr(rows, name, given)


@pytest.mark.parametrize("rows_type", _TYPES)
@pytest.mark.parametrize(
    ("mask", "kept"),
    [(np.array([False, True]), [1]), (np.array([1, 0]), [1, 0]), (slice(0, 1), [0]), (np.array([False, False]), [])],
    ids=["boolean", "indices", "slice", "nothing"],
)
def test_indexing_returns_the_same_type_with_those_rows(rows_type: type[Any], mask: Any, kept: list[int]) -> None:
    rows = rows_type(**_ROWS[rows_type])
    part = rows[mask]
    assert type(part) is rows_type
    assert len(part) == len(kept)
    for field in dataclasses.fields(rows_type):
        expected = getattr(rows, field.name)[kept]
        np.testing.assert_array_equal(getattr(part, field.name), expected)
        assert getattr(part, field.name).dtype == expected.dtype
        assert not getattr(part, field.name).flags.writeable


@pytest.mark.parametrize("rows_type", _TYPES)
def test_one_row_alone_or_rows_of_rows_are_refused(rows_type: type[Any]) -> None:
    rows = rows_type(**_ROWS[rows_type])
    for wrong in (0, np.array([[0, 1]])):
        with pytest.raises(ValueError, match="takes a mask"):
            rows[wrong]


@pytest.mark.parametrize("rows_type", _TYPES)
def test_empty_has_no_rows_and_whole_shapes(rows_type: type[Any]) -> None:
    empty, full = rows_type.empty(), rows_type(**_ROWS[rows_type])
    assert len(empty) == 0
    for field in dataclasses.fields(rows_type):
        column = getattr(empty, field.name)
        assert column.shape == (0, *getattr(full, field.name).shape[1:])
        assert column.dtype == getattr(full, field.name).dtype


@pytest.mark.parametrize("rows_type", _TYPES)
def test_a_column_of_another_length_or_shape_is_refused(rows_type: type[Any]) -> None:
    for name, value in _ROWS[rows_type].items():
        with pytest.raises(ValueError, match="rows, the others"):
            rows_type(**{**_ROWS[rows_type], name: np.array(value)[:1]})
        with pytest.raises(ValueError, match="must be"):
            rows_type(**{**_ROWS[rows_type], name: np.array(value)[:, None]})


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"xyxy_px": [[0, 1, np.nan, 3], [4, 5, 6, 7]]}, "finite"),
        ({"score": [0.5, np.nan]}, "finite"),
        ({"xyxy_px": [[9, 1, 2, 3], [4, 5, 6, 7]]}, "left, top, right, bottom"),
        ({"score": [0.5, 1.1]}, "between 0 and 1"),
    ],
)
def test_impossible_detections_are_refused(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Detections(**{**_ROWS[Detections], **changes})


@pytest.mark.parametrize("xy_m", [[[1.0, 2.0], [3.0, 4.0]], [[np.nan, 2.0], [np.nan, np.nan]]])
def test_a_position_is_finite_exactly_where_it_is_valid(xy_m: list[list[float]]) -> None:
    with pytest.raises(ValueError, match="NaN where not"):
        GroundPositions(**{**_ROWS[GroundPositions], "xy_m": xy_m})


def test_a_pair_has_its_smaller_id_first() -> None:
    with pytest.raises(ValueError, match="smaller"):
        Proximities(**{**_ROWS[Proximities], "track_a": [2, 1]})


def test_no_ground_map_is_false_and_says_why_and_a_map_is_true() -> None:
    missing = NoGroundMap("no reference object")
    assert not missing
    assert missing.reason == "no reference object"
    assert ground_map()


@pytest.mark.parametrize("name", ["image_to_ground", "covariance", "valid_px", "anchors_px"])
def test_a_ground_map_refuses_nan_and_is_read_only(name: str) -> None:
    shape = {"image_to_ground": (3, 3), "covariance": (9, 9)}.get(name, (4, 2))
    with pytest.raises(ValueError, match="finite"):
        ground_map(**{name: np.full(shape, np.nan)})
    with pytest.raises(ValueError, match="read-only"):
        getattr(ground_map(**{name: np.ones(shape)}), name)[0, 0] = 2.0


def test_a_ground_map_refuses_matrices_of_another_shape() -> None:
    with pytest.raises(ValueError, match="reshape"):
        ground_map(image_to_ground=np.eye(4))
    with pytest.raises(ValueError, match="must be"):
        ground_map(covariance=np.eye(8))


def test_a_covariance_of_the_entries_alone_says_that_the_lens_is_taken_as_it_is() -> None:
    padded = ground_map(covariance=np.eye(9)).covariance
    np.testing.assert_array_equal(padded[:9, :9], np.eye(9))
    assert not padded[9].any() and not padded[:, 9].any()


def test_a_ground_map_goes_to_the_ground_and_back_through_the_lens() -> None:
    camera = Camera(
        640,
        480,
        np.array([[500.0, 0.0, 320.0], [0.0, 500.0, 240.0], [0.0, 0.0, 1.0]]),
        np.array([-0.25, 0.05, 0.001, 0.0, 0.0]),
    )
    through_lens, points_px = ground_map(camera=camera), np.array([[10.0, 20.0], [600.0, 470.0], [320.0, 240.0]])
    ground, valid = through_lens.to_ground(points_px)
    assert valid.all()
    assert np.abs(ground - ground_map().to_ground(points_px)[0]).max() > 1.0
    np.testing.assert_allclose(through_lens.to_image(ground)[0], points_px, atol=1e-6)


def test_a_ground_map_gives_nan_for_what_the_lens_cannot_see() -> None:
    lens = Camera(640, 480, np.array([[300.0, 0, 320.0], [0, 300.0, 240.0], [0, 0, 1.0]]), np.array([-0.3, 0, 0, 0, 0]))
    ground, valid = ground_map(camera=lens).to_ground(np.array([[320.0, 240.0], [639.0, 479.0]]))
    assert valid.tolist() == [True, False]
    assert np.isnan(ground[1]).all()


def test_a_ground_map_draws_nothing_where_the_lens_sees_nothing() -> None:
    lens = Camera(640, 480, np.array([[300.0, 0, 320.0], [0, 300.0, 240.0], [0, 0, 1.0]]), np.array([-0.3, 0, 0, 0, 0]))
    # 2 focal lengths off the axis the polynomial folds back to x (1 - 0.3 * 4) = -0.4, inside the picture.
    points_px, valid = ground_map(camera=lens).to_image(np.array([[32.0, -24.0], [32.0 + 60.0, -24.0]]))
    assert valid.tolist() == [True, False]
    assert np.isnan(points_px[1]).all()


@pytest.mark.parametrize("rows_type", [Detections, Tracks])
def test_ground_points_may_be_left_out_and_are_unknown_then(rows_type: type[Any]) -> None:
    given = {name: value for name, value in _ROWS[rows_type].items() if not name.startswith("foot")}
    rows = rows_type(**given)
    assert np.isnan(rows.foot_px).all() and rows.foot_px.shape == (2, 2)
    assert rows.foot_covariance_px2.shape == (2, 2, 2)
    both = rows_type.joined([rows, rows[np.array([False, True])]])
    assert len(both) == 3 and np.isnan(both.foot_px).all()
    covariance = np.stack([np.eye(2), np.full((2, 2), np.nan)])
    with pytest.raises(ValueError, match="finite where foot_px is"):
        rows_type(**given, foot_px=np.zeros((2, 2)), foot_covariance_px2=covariance)
    with pytest.raises(ValueError, match="finite or NaN"):
        rows_type(**given, foot_px=np.array([[np.inf, 0.0], [0.0, 0.0]]), foot_covariance_px2=covariance)
