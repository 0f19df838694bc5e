"""How often the ground map of one picture is missing or wrong where the reference's shape is known, on drawn pictures.

python examples/known_shape.py

Flat squares and rectangles, as a calibrated camera sees them, in the pictures of `standoff evaluate rectification`.
"""

from __future__ import annotations

import numpy as np

from standoff.core.camera import Camera, CameraPrior
from standoff.core.classes import CLASS_BY_NAME
from standoff.core.homography import FloatArray
from standoff.core.pose import View
from standoff.core.types import Detections, Frame, GroundMap, NoCameraMotion
from standoff.evaluation.drawn_quadrilaterals import DIFFICULTIES, SIZE_PX, Difficulty, draw_quadrilateral
from standoff.stages.frames import ArrayPicture
from standoff.stages.ground import FusedGround, FusedParams, Reference, ReferenceParams, ReferenceShape

_MIDDLE = (SIZE_PX - 1) / 2.0
CAMERA = Camera(SIZE_PX, SIZE_PX, np.array([[SIZE_PX, 0, _MIDDLE], [0, SIZE_PX, _MIDDLE], [0, 0, 1.0]]), np.zeros(5))
SHAPES = {"square": ReferenceShape.square(2.89), "rectangle": ReferenceShape.rectangle(2.0, 3.0)}
SCENES = 300
_WRONG_PX = 5.0
_LEAST_SIDE_PX, _BORDER_PX = 50.0, 25.0


def seen_corners(shape: ReferenceShape, rng: np.random.Generator) -> FloatArray:
    """Return (4, 2) where a random camera above the ground sees a shape's corners."""
    while True:
        aimed = View.aimed(CAMERA, np.zeros(3), heading_deg=rng.uniform(0, 360), pitch_deg=rng.uniform(30, 80))
        target_m = np.append(shape.corners_m.mean(axis=0) + rng.uniform(-0.2, 0.2, 2), 0.0)
        view = View(CAMERA, target_m - rng.uniform(4.0, 6.5) * aimed.site_to_camera[2], aimed.site_to_camera)
        corners_px = view.project(np.column_stack([shape.corners_m, np.zeros(4)]))
        sides_px = np.linalg.norm(np.roll(corners_px, -1, axis=0) - corners_px, axis=1)
        inside = ((corners_px > _BORDER_PX) & (corners_px < SIZE_PX - _BORDER_PX)).all()
        if inside and sides_px.min() > _LEAST_SIDE_PX:
            return corners_px


def worst_corner_px(shape: ReferenceShape, difficulty: Difficulty, index: int) -> float | None:
    """Return how far the worst corner is off in one picture; None where there is no map."""
    corners_px = seen_corners(shape, np.random.default_rng([7, index]))
    scene = draw_quadrilateral(difficulty, 7, index, corners_px=corners_px)
    reference = Reference(shape, 0.0, params=ReferenceParams(method="refined"))
    ground = FusedGround(
        [reference], camera=CameraPrior.calibrated(CAMERA), params=FusedParams(sizes=False), remember=False
    )
    detections = Detections(scene.box_xyxy_px[None], np.array([0.9]), np.array([CLASS_BY_NAME["reference"].id]))
    picture = ArrayPicture(np.repeat(scene.gray[:, :, None], 3, axis=2))
    result = ground.update(Frame("drawn", index, 0.0, picture), detections, NoCameraMotion("one picture"))
    if not isinstance(result, GroundMap):
        return None
    turned = (np.roll(result.anchors_px, k, axis=0) for k in range(4))
    return min(float(np.linalg.norm(one - corners_px, axis=1).max()) for one in turned)


def main() -> None:
    """Print a line for each shape and class of pictures."""
    for name, shape in SHAPES.items():
        for difficulty in DIFFICULTIES:
            worst = [worst_corner_px(shape, difficulty, index) for index in range(SCENES)]
            off = np.array([one for one in worst if one is not None])
            rmse = np.sqrt((off[off <= _WRONG_PX] ** 2).mean())
            print(
                f"{name}, {difficulty}: no map {100 * (1 - len(off) / SCENES):.1f} %, "
                f"wrong {100 * (off > _WRONG_PX).sum() / SCENES:.1f} %, worst corner of the rest {rmse:.3f} px (rms)"
            )


if __name__ == "__main__":
    main()
