"""Points of the truth through each frame's own ground map, with the errors that the map states for them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from standoff.clips import Clip
from standoff.core.homography import FloatArray
from standoff.core.map_error import map_jacobian
from standoff.core.pose import View
from standoff.core.types import GroundMap
from standoff.evaluation.paper.corner_order import CornerOrder
from standoff.stages.ground import load_camera


@dataclass(frozen=True, slots=True, eq=False)
class MappedPoints:
    """One point of each entity (E) in each frame (F).

    Attributes:
        xy_m: (F, E, 2) site frame; NaN without a map, where the entity cannot be seen, or beyond the horizon.
        covariance_m2: (F, E, 2, 2) of the map alone; NaN as before.
    """

    xy_m: FloatArray
    covariance_m2: FloatArray

    @classmethod
    def blank(cls, frames: int, entities: int) -> Self:
        """Return arrays to be filled in."""
        return cls(np.full((frames, entities, 2), np.nan), np.full((frames, entities, 2, 2), np.nan))

    def take(self, frame: int, points_px: FloatArray, ground: GroundMap, turning: CornerOrder, turn: int) -> None:
        """Map the points of a frame.

        Args:
            frame: Its index.
            points_px: (E, 2) as seen in the picture; NaN where the entity does not count.
            ground: The frame's map.
            turning: Brings positions to the site frame of the truth.
            turn: By how much, for this frame.
        """
        jacobian = map_jacobian(ground, ground.undistorted(points_px))
        xy_m, _ = ground.to_ground(points_px)
        covariance_m2 = jacobian @ ground.covariance @ jacobian.transpose(0, 2, 1)
        self.xy_m[frame] = turning.to_site(xy_m, turn)
        self.covariance_m2[frame] = turning.covariance_to_site(covariance_m2, turn)


def level_feet_px(clip: Clip) -> FloatArray:
    """Return (F, E, 2) where the picture would show feet on ground that is everywhere as high as under the reference.

    NaN behind the camera.

    Args:
        clip: With a reference object.

    Raises:
        GroundError: The clip's camera file is broken.
    """
    assert clip.reference is not None, "only such clips have a map"
    camera = load_camera(clip.camera_file)
    feet_px = np.full_like(clip.xy_m, np.nan)
    for frame, xy_m in enumerate(clip.xy_m):
        view = View(camera, clip.camera_m[frame], clip.site_to_camera[frame])
        feet_px[frame] = view.project(np.column_stack([xy_m, np.full(len(xy_m), clip.reference.ground_m)]))
    return feet_px
