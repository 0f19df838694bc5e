"""From joint values to the place of every part of the body: pelvis and feet first, then whatever hangs on them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from standoff.core.homography import FloatArray
from standoff_sim.people import anthropometry as ratio
from standoff_sim.people.anthropometry import Body
from standoff_sim.people.gait import Footing, Sole, amplitude, arm_swing_deg, ease, footing
from standoff_sim.solids.mesh import crossed, rotation, scaling, translation

SIDES = (1.0, -1.0)
"""Sign of y of the left and the right side; pairs are always in this order."""
_ELBOW_TOWARDS = np.array([-0.6, 0.35, -0.5])
_LOWEST_WRIST_M = 0.18


@dataclass(frozen=True, slots=True)
class Stance:
    """Joint values and the habits of one person that go with them.

    Attributes:
        phase: Of the left leg's walking cycle.
        step_m: Full step length.
        speed_mps: Of the walk.
        bend_deg: Of the upper body forward.
        crouch: 0 standing .. 1 squatting or kneeling.
        turn_deg: Of the upper body to the left.
        toes_out_deg: Of each foot.
        feet_apart_m: Half the distance between the ankles.
        ahead_m: How far the left foot is ahead of the right when standing.
        kneeling: Whether crouching ends on the right knee.
        look_deg: How far the head is turned to the left.
    """

    phase: float
    step_m: float
    speed_mps: float
    bend_deg: float
    crouch: float
    turn_deg: float
    toes_out_deg: float = 6.0
    feet_apart_m: float = 0.09
    ahead_m: float = 0.0
    kneeling: bool = False
    look_deg: float = 0.0

    @property
    def walk(self) -> float:
        """Return how much of a walk this is, 0..1."""
        return amplitude(self.speed_mps)


@dataclass(frozen=True, slots=True, eq=False)
class Trunk:
    """Everything but the arms.

    Attributes:
        frames: (4, 4) of "pelvis", "chest" and "head", (2, 4, 4) of "thigh", "shin" and "boot", left first; scaled.
        chest: (4, 4) unscaled frame of the chest, at the waist.
        heading: (3, 3) upright axes that share the chest's turn.
        shoulders_m: (2, 3).
    """

    frames: Mapping[str, FloatArray]
    chest: FloatArray
    heading: FloatArray
    shoulders_m: FloatArray


def stand(body: Body, stance: Stance, sole: Sole) -> Trunk:
    """Put pelvis, legs, chest and head where a stance has them; the lowest sole rests on z = 0."""
    ankles_m, boots = _feet(body, stance, sole)
    crouch = max(stance.crouch, 0.10 * np.sin(np.deg2rad(stance.bend_deg)))
    pelvis_yaw_deg = 0.25 * stance.turn_deg - 5.0 * stance.walk * np.cos(2.0 * np.pi * stance.phase)
    hips_m = _hips(body, stance, ankles_m, crouch, pelvis_yaw_deg)
    thighs, shins = _legs(body, hips_m, ankles_m, crouch)

    trunk_m = body.stature_m * body.trunk_share
    # Nobody squats with a level back: the elbows of a turned trunk would be in the ground.
    lean_deg = min(stance.bend_deg + 25.0 * crouch + 3.0 * stance.walk, 95.0 - 22.0 * stance.crouch)
    pelvis = translation(*hips_m.mean(axis=0)) @ rotation("z", pelvis_yaw_deg) @ rotation("y", 0.6 * lean_deg)
    chest_yaw_deg = 1.2 * stance.turn_deg - 1.8 * pelvis_yaw_deg
    chest = pelvis @ translation(0.0, 0.0, (ratio.WAIST_HEIGHT - ratio.HIP_HEIGHT) * trunk_m)
    chest = chest @ rotation("y", 0.4 * lean_deg) @ rotation("z", chest_yaw_deg)
    head = chest @ translation(0.01, 0.0, (ratio.HEAD_PIVOT_HEIGHT - ratio.WAIST_HEIGHT) * trunk_m)
    head = head @ rotation("y", 8.0 - 0.35 * lean_deg) @ rotation("z", 0.2 * stance.turn_deg + stance.look_deg)

    shoulder_z_m = (ratio.SHOULDER_HEIGHT - ratio.WAIST_HEIGHT) * trunk_m
    half_breadth_m = ratio.SHOULDER_JOINT_Y * body.stature_m * (0.5 + 0.5 * body.girth)
    shoulders_m = np.array([(chest @ [0.0, side * half_breadth_m, shoulder_z_m, 1.0])[:3] for side in SIDES])
    size = scaling(body.scale * body.girth, body.scale * body.girth, body.scale * body.trunk_share)
    frames = {
        "pelvis": pelvis @ size,
        "chest": chest @ size,
        "head": head @ scaling(*(body.scale,) * 3),
        "thigh": thighs,
        "shin": shins,
        "boot": boots,
    }
    return Trunk(frames, chest, rotation("z", pelvis_yaw_deg + chest_yaw_deg)[:3, :3], shoulders_m)


def _hips(body: Body, stance: Stance, ankles_m: FloatArray, crouch: float, yaw_deg: float) -> FloatArray:
    """Return the hip joints (2, 3): as high as the legs reach, lower and further back in a crouch or a bend."""
    back = 0.09 * np.sin(np.deg2rad(stance.bend_deg)) + (0.02 if stance.kneeling else 0.07) * crouch
    spread_m = np.array([[0.0, side * ratio.HIP_JOINT_Y * body.stature_m, 0.0] for side in SIDES])
    hips_m: FloatArray = spread_m @ rotation("z", yaw_deg)[:3, :3].T - [back * body.stature_m, 0.0, 0.0]
    standing_m = _hip_height_m(body, ankles_m, hips_m, 0.995 - 0.02 * stance.walk)
    crouched_m = min(body.stature_m * (0.285 if stance.kneeling else 0.23), standing_m)
    hips_m[:, 2] = standing_m + ease(crouch) * (crouched_m - standing_m)
    return hips_m


def _feet(body: Body, stance: Stance, sole: Sole) -> tuple[FloatArray, FloatArray]:
    """Return the ankles (2, 3) and the scaled frames of the boots (2, 4, 4)."""
    still = 1.0 - stance.walk
    knelt = ease(stance.crouch) * still * stance.kneeling
    ankles_m, boots = np.zeros((2, 3)), np.zeros((2, 4, 4))
    for i, side in enumerate(SIDES):
        foot = footing(stance.phase + 0.5 * i, stance.step_m, stance.walk, sole)
        if knelt:
            pitch_deg = foot.pitch_deg - (70.0 * knelt if side < 0 else 0.0)
            x_m = foot.x_m + (0.12 if side > 0 else -0.24) * body.stature_m * knelt
            rolled_m, height_m = sole.resting(pitch_deg)
            foot = Footing(x_m, height_m, pitch_deg, rolled_m)
        outwards = 0.0 if stance.kneeling else ease(stance.crouch)
        turn = rotation("z", side * stance.toes_out_deg * (1.0 + 2.0 * outwards))
        # The sole rolls along the foot, which does not point straight ahead.
        ankles_m[i] = foot.rolled_m * (turn[:3, 0] - [1.0, 0.0, 0.0])
        ankles_m[i] += (
            foot.x_m + side * stance.ahead_m * still / 2,
            side * (stance.feet_apart_m + 0.05 * outwards),
            foot.z_m,
        )
        boots[i] = translation(*ankles_m[i]) @ turn @ rotation("y", -foot.pitch_deg) @ scaling(*(body.scale,) * 3)
    return ankles_m, boots


def _hip_height_m(body: Body, ankles_m: FloatArray, hips_m: FloatArray, extension: float) -> float:
    """Return the height at which the leg that reaches less far is straight, with a rounded change of legs."""
    leg_m = (body.thigh_m + body.shank_m) * extension
    aside_m2 = ((ankles_m - hips_m)[:, :2] ** 2).sum(axis=1)
    reach_m = ankles_m[:, 2] + np.sqrt(np.maximum(leg_m**2 - aside_m2, 0.2 * leg_m**2))
    softness_m = 0.01
    return float(-softness_m * np.logaddexp(*(-reach_m / softness_m)))


def _legs(body: Body, hips_m: FloatArray, ankles_m: FloatArray, crouch: float) -> tuple[FloatArray, FloatArray]:
    thickness = body.scale * (0.3 + 0.7 * body.girth)
    size = scaling(thickness, thickness, body.scale * body.leg_share)
    thighs, shins = np.empty((2, 4, 4)), np.empty((2, 4, 4))
    for i, side in enumerate(SIDES):
        ahead = np.array([1.0, side * (0.08 + 0.35 * crouch), 0.0])
        knee_m = hinge(hips_m[i], ankles_m[i], (body.thigh_m, body.shank_m), ahead)
        thighs[i] = limb(hips_m[i], knee_m, ahead) @ size
        shins[i] = limb(knee_m, ankles_m[i], ahead) @ size
    return thighs, shins


def hinge(root_m: FloatArray, end_m: FloatArray, lengths_m: tuple[float, float], towards: FloatArray) -> FloatArray:
    """Return where the middle joint of two rigid bones is.

    Args:
        root_m: (3,) upper end of the first bone.
        end_m: (3,) lower end of the second; drawn nearer along the line when it is out of reach.
        lengths_m: Of the bones.
        towards: (3,) the side to which the joint bends.
    """
    first, second = lengths_m
    offset = end_m - root_m
    distance = float(np.linalg.norm(offset))
    straight = offset / distance
    distance = min(max(distance, abs(first - second) + 1e-3), first + second)
    along = (first**2 - second**2 + distance**2) / (2.0 * distance)
    sideways = towards - straight * (straight @ towards)
    sideways /= np.linalg.norm(sideways)
    joint: FloatArray = root_m + along * straight + np.sqrt(max(first**2 - along**2, 0.0)) * sideways
    return joint


def limb(root_m: FloatArray, end_m: FloatArray, front: FloatArray) -> FloatArray:
    """Return the (4, 4) frame of a limb that hangs from `root_m` along its own -z, x as near to `front` as possible."""
    up = root_m - end_m
    up = up / np.linalg.norm(up)
    left = crossed(up, front)
    left /= np.linalg.norm(left)
    frame = np.eye(4)
    frame[:3, :3] = np.column_stack([crossed(left, up), left, up])
    frame[:3, 3] = root_m
    return frame


def hanging_wrists(body: Body, stance: Stance, trunk: Trunk) -> FloatArray:
    """Return (2, 3) where the wrists are when the arms hang and swing."""
    wrists_m = np.empty((2, 3))
    for i, side in enumerate(SIDES):
        swing_deg, elbow_deg = arm_swing_deg(stance.phase + 0.5 * i, stance.speed_mps)
        out = 0.10 + 0.25 * max(body.girth - 1.0, 0.0)
        elbow = rotation("y", -swing_deg)[:3, :3] @ [0.0, side * out, -1.0] * body.upper_arm_m
        wrist = rotation("y", -swing_deg - elbow_deg)[:3, :3] @ [0.0, side * 0.05, -1.0] * body.forearm_m
        wrists_m[i] = trunk.shoulders_m[i] + trunk.heading @ (elbow + wrist)
    return wrists_m


def reach(body: Body, trunk: Trunk, wrists_m: FloatArray) -> Mapping[str, FloatArray]:
    """Return the scaled (2, 4, 4) frames of "upper_arm", "forearm" and "hand" for wrists (2, 3) wanted somewhere."""
    wanted_m = wrists_m.copy()
    wanted_m[:, 2] = np.maximum(wanted_m[:, 2], _LOWEST_WRIST_M)
    thickness = body.scale * (0.3 + 0.7 * body.girth)
    size = scaling(thickness, thickness, body.scale)
    bones_m = body.upper_arm_m, body.forearm_m
    frames = {name: np.empty((2, 4, 4)) for name in ("upper_arm", "forearm", "hand")}
    for i, side in enumerate(SIDES):
        towards = trunk.chest[:3, :3] @ (_ELBOW_TOWARDS * [1.0, side, 1.0])
        elbow_m = hinge(trunk.shoulders_m[i], wanted_m[i], bones_m, towards)
        reached_m = wanted_m[i] - elbow_m
        wrist_m = elbow_m + reached_m * body.forearm_m / np.linalg.norm(reached_m)
        front = trunk.heading @ [1.0, -0.3 * side, 0.3]
        frames["upper_arm"][i] = limb(trunk.shoulders_m[i], elbow_m, front) @ size
        frames["forearm"][i] = limb(elbow_m, wrist_m, front) @ size
        frames["hand"][i] = frames["forearm"][i].copy()
        frames["hand"][i][:3, 3] = wrist_m
    return frames
