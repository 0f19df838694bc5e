"""Compile the loops that most tests run through, before several workers would each compile all of them."""

from __future__ import annotations

import numpy as np
from drawn_ground import frame
from drawn_solid import box_around, drawn, lens, looking_at
from flown_ground import flight, follow
from flown_ground import seen as flown

from standoff.core.camera import CameraPrior
from standoff.core.classes import CLASS_BY_NAME
from standoff.core.types import Detections, GroundMap, NoCameraMotion
from standoff.stages.ground import FusedGround, GivenPlace, Reference, ReferenceGround, ReferenceParams, ReferenceShape
from standoff.stages.ground.solid import SolidState


def main() -> None:
    """Follow a moving picture, and find one solid in three ways."""
    follow([flown(flight(index / 25.0)) for index in range(3)])
    shape, camera = ReferenceShape.square(2.89), lens()
    state = SolidState(looking_at(camera, (1.4, 1.4), away_m=12.0, heading_deg=25.0, pitch_deg=50.0), 0.4)
    box = box_around(shape, state)
    seen = Detections(box[None], np.array([0.9]), np.array([CLASS_BY_NAME["reference"].id]))
    still, picture = NoCameraMotion("one picture"), frame(drawn(shape, state), 0.0)
    for height_m in (0.4, None):
        ground = FusedGround([Reference(shape, height_m)], camera=CameraPrior.calibrated(camera))
        for _ in range(2):
            assert isinstance(ground.update(picture, seen, still), GroundMap)
    flat = frame(drawn(shape, SolidState(state.view, 0.0)), 0.0)
    oriented = ReferenceGround(shape, ReferenceParams(method="oriented"), place=GivenPlace(tuple(box)))
    assert isinstance(oriented.update(flat, seen, still), GroundMap)


if __name__ == "__main__":
    main()
