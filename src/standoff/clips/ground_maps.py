"""The ground map in a run's `frames` table: what is written of it, and how it is read again."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import numpy as np
import pyarrow as pa

from standoff.clips.columns import Column
from standoff.core.camera import COEFFICIENTS, Camera, Lens
from standoff.core.ground_map import GroundMap, NoGroundMap
from standoff.core.homography import FloatArray

_NUMBERS: Final = pa.list_(pa.float64())
_TRIANGLE: Final = np.tril_indices(10)

MAP_COLUMNS: Final[tuple[Column, ...]] = (
    ("map", pa.bool_(), "", "whether there is a ground map; false: nothing was measured in this frame"),
    ("map_method", pa.string(), "", "how the map was found; null without a map"),
    ("map_reason", pa.string(), "", "why there is no map; null with a map"),
    ("map_age_s", pa.float64(), "s", "since the map was last observed; null without a map"),
    ("scale_m_per_px", pa.float64(), "m/px", "Eq. 6's scale; null without a map"),
    ("image_to_ground", _NUMBERS, "", "3 x 3, undistorted pixels to metres, row by row; null without"),
    (
        "map_covariance",
        _NUMBERS,
        "",
        "of image_to_ground's 9 numbers and the lens's first coefficient: lower triangle of 10 x 10; null without",
    ),
    (
        "lens",
        _NUMBERS,
        "",
        "fx, fy, cx, cy in px, then 5 coefficients (Brown) or 4 (fisheye); null: no distortion",
    ),
    ("anchors_px", _NUMBERS, "px", "x, y of each point that fixed the map, as seen in the picture; null without a map"),
)
"""All that is needed to place points of the picture on the ground again, with their errors."""


def map_values(ground: GroundMap | NoGroundMap) -> dict[str, Any]:
    """Return the value of each of `MAP_COLUMNS`."""
    values: dict[str, Any] = dict.fromkeys(name for name, *_ in MAP_COLUMNS)
    if isinstance(ground, NoGroundMap):
        return {**values, "map": False, "map_reason": ground.reason}
    return {
        **values,
        "map": True,
        "map_method": ground.method,
        "map_age_s": ground.age_s,
        "scale_m_per_px": ground.scale_m_per_px,
        "image_to_ground": ground.image_to_ground.ravel().tolist(),
        "map_covariance": ground.covariance[_TRIANGLE].tolist(),
        "lens": None if ground.camera is None else _numbers_of(ground.camera),
        "anchors_px": ground.anchors_px.ravel().tolist(),
    }


def map_of(values: Mapping[str, Any], size_px: tuple[int, int]) -> GroundMap | NoGroundMap:
    """Return the map that a row of the table holds.

    It places points and states their errors as the run's did. Where it was trusted (`valid_px`) and how the ground lies
    off its plane (`relief`) are not in the table.

    Args:
        values: Of `MAP_COLUMNS`, by name.
        size_px: (width, height) of the pictures.

    Raises:
        ValueError: They cannot be of a map.
    """
    if not values["map"]:
        return NoGroundMap(str(values["map_reason"]))
    lower, lens = np.zeros((10, 10)), values["lens"]
    lower[_TRIANGLE] = _floats(values["map_covariance"])
    return GroundMap(
        image_to_ground=_floats(values["image_to_ground"]).reshape(3, 3),
        covariance=lower + np.tril(lower, -1).T,
        image_size_px=size_px,
        method=str(values["map_method"]),
        scale_m_per_px=float(values["scale_m_per_px"]),
        anchors_px=_floats(values["anchors_px"]).reshape(-1, 2),
        camera=None if lens is None else _camera_of(_floats(lens), size_px),
        age_s=float(values["map_age_s"]),
    )


def _numbers_of(camera: Camera) -> list[float]:
    matrix = camera.matrix
    return [*map(float, (matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2])), *camera.distortion.tolist()]


def _camera_of(numbers: FloatArray, size_px: tuple[int, int]) -> Camera:
    focal_x, focal_y, centre_x, centre_y = numbers[:4].tolist()
    matrix = np.array([[focal_x, 0.0, centre_x], [0.0, focal_y, centre_y], [0.0, 0.0, 1.0]])
    lens: Lens = "fisheye" if len(numbers) == 4 + COEFFICIENTS["fisheye"] else "brown"
    return Camera(*size_px, matrix, numbers[4:], lens)


def _floats(values: Any) -> FloatArray:  # noqa: ANN401 - a cell of a column of lists
    return np.array(values, dtype=np.float64)
