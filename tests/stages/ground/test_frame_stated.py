"""Whether places of a plan can be found in a map: only where somebody stated where its site frame lies."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from drawn_ground import frame
from drawn_solid import box_around, drawn, lens, looking_at, motion_between, top_px
from stages.ground.test_reference import FOOTING, NOTHING, QUADRILATERAL, detected, mapped, seen

from standoff.core.camera import CameraPrior
from standoff.core.types import GroundMap, NoCameraMotion
from standoff.stages.ground import FusedGround, FusedParams, Reference, ReferenceGround, ReferenceParams, ReferenceShape
from standoff.stages.ground.reference_box import GivenPlace
from standoff.stages.ground.solid import SolidState

SHAPE = ReferenceShape.rectangle(2.0, 2.89)
CAMERA = lens()
STILL = NoCameraMotion("not estimated")
FPS = 5.0


def turned_by(heading_deg: float) -> SolidState:
    return SolidState(looking_at(CAMERA, (1.2, 1.6), away_m=12.0, heading_deg=heading_deg, pitch_deg=50.0), 0.4)


def run(
    headings_deg: Sequence[float],
    *,
    hint: bool = True,
    hidden: Sequence[int] = (),
    broken: Sequence[int] = (),
    step_s: float = 1 / FPS,
) -> list[GroundMap]:
    """Follow a rectangle; in hidden frames it is not in the picture, in broken ones the motion is not known."""
    states = [turned_by(heading_deg) for heading_deg in headings_deg]
    place = GivenPlace(
        box_around(SHAPE, states[0]), first_corner_px=top_px(SHAPE, states[0])[0] + 3.0 if hint else None
    )
    ground = FusedGround(
        [Reference(SHAPE, 0.4, place, ReferenceParams(size_sigma=0.0))],
        camera=CameraPrior.calibrated(CAMERA),
        params=FusedParams(sizes=False),
    )
    maps = []
    for k, state in enumerate(states):
        picture = drawn(SHAPE, state, seed=k, solid=k not in hidden)
        motion = STILL if k == 0 or k in broken else motion_between(states[0].view, state.view, 0.0)
        result = ground.update(frame(picture, k * step_s), NOTHING, motion)
        if isinstance(result, GroundMap):
            maps.append(result)
    return maps


def test_a_reference_that_looks_the_same_turned_round_states_its_frame_only_with_its_first_corner() -> None:
    assert [one.frame_stated for one in run([25.0, 26.0])] == [True, True]
    assert [one.frame_stated for one in run([25.0, 26.0], hint=False)] == [False, False]


@pytest.mark.parametrize(("step_s", "stated"), [(1.5, True), (2.5, False)])
def test_once_it_is_lost_for_long_nobody_knows_which_corner_is_which(step_s: float, stated: bool) -> None:
    last = run([25.0, 25.0], broken=(1,), step_s=step_s)[-1]
    assert last.age_s == 0.0
    assert last.frame_stated == stated


def test_a_camera_that_turns_while_the_reference_is_hidden_finds_the_same_corner_first() -> None:
    headings_deg = [25.0, 25.0, 60.0, 95.0, 130.0, 165.0, 165.0]
    last = run(headings_deg, hidden=range(2, 6), broken=(6,))[-1]
    assert last.age_s == 0.0 and last.frame_stated
    state = turned_by(165.0)
    places_px = state.view.project(np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 5.0, 0.0]]))
    found_m, _ = last.to_ground(places_px)
    np.testing.assert_allclose(found_m, [[0.0, 0.0], [2.0, 0.0], [0.0, 5.0]], atol=0.1)


def test_frame_by_frame_the_shape_or_the_hint_state_the_frame() -> None:
    gray, _, box = seen(QUADRILATERAL)
    plain = ReferenceGround(QUADRILATERAL, place=GivenPlace(box_xyxy_px=box))
    assert mapped(plain.update(frame(gray), NOTHING, STILL)).frame_stated
    gray, _, box = seen(FOOTING)
    middle = (box[:2] + box[2:]) / 2.0
    for hint, expected in ((None, False), (np.array([middle[0], box[3]]), True)):
        stage = ReferenceGround(FOOTING, place=GivenPlace(first_corner_px=hint))
        assert mapped(stage.update(frame(gray), detected(box), STILL)).frame_stated == expected
        # Seen again from elsewhere, after the memory of its outline has faded.
        later, _, there = seen(FOOTING, yaw_deg=110.0)
        assert not mapped(stage.update(frame(later, 9.0), detected(there), STILL)).frame_stated
