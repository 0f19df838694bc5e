"""Settings of the camera motion."""

from dataclasses import dataclass
from typing import Annotated

from annotated_types import Ge, Gt, Interval
from typing_extensions import Doc


@dataclass(frozen=True, slots=True)
class MotionParams:
    """How the picture is followed from a keyframe.

    Lengths are in pixels of the picture as it is followed, `width_px` wide or less. The defaults were chosen on
    simulated clips of the presets demo, mobile, lost-reference and busy, seed 11; see docs/motion.md.
    """

    width_px: Annotated[
        int,
        Ge(160),
        Doc("Pictures are followed at about this width; wider ones are shrunk first."),
    ] = 960
    points: Annotated[
        int,
        Ge(24),
        Doc("Points that are followed, at most: the best of each cell of a grid over the picture."),
    ] = 112
    window_px: Annotated[
        int,
        Ge(7),
        Doc("Side of the patch that is compared around each point; px of the followed picture."),
    ] = 15
    round_trip_px: Annotated[
        float,
        Gt(0),
        Doc("A point that does not come back to within this when followed backwards is left out; followed px."),
    ] = 0.5
    inlier_px: Annotated[
        float,
        Gt(0),
        Doc("Points further than this from the common motion of most are not of the same plane; followed px."),
    ] = 1.5
    min_points: Annotated[
        int,
        Ge(8),
        Doc("Fewer points of the ground than this are too little to follow."),
    ] = 12
    min_inliers: Annotated[
        float,
        Interval(gt=0, le=1),
        Doc("Smallest share of the points in view that must move together."),
    ] = 0.35
    min_overlap: Annotated[
        float,
        Interval(gt=0, lt=1),
        Doc("A new keyframe is taken when fewer of its points than this share are still in view."),
    ] = 0.6
    max_turn_deg: Annotated[
        float,
        Interval(gt=0, le=45),
        Doc("A new keyframe is taken when the picture has turned by more than this; degrees."),
    ] = 10.0
    max_scale: Annotated[
        float,
        Gt(1),
        Doc("A new keyframe is taken when the picture has grown or shrunk by more than this factor."),
    ] = 1.15
    max_lost_s: Annotated[
        float,
        Ge(0),
        Doc("Seconds without a motion after which the keyframe is given up for a new one."),
    ] = 1.0
    zoom_rate: Annotated[
        float,
        Gt(0),
        Doc("The camera zooms where the whole picture grows or shrinks faster than this; logarithm of scale a second."),
    ] = 0.75
    cut_likeness: Annotated[
        float,
        Interval(ge=-1, le=1),
        Doc("A picture that cannot be followed and is less like the one before than this (correlation) was cut."),
    ] = 0.8
    mover_margin: Annotated[
        float,
        Ge(0),
        Doc("Boxes of people and machines are left out, widened on each side by this share of their size."),
    ] = 0.1
    mover_growth: Annotated[
        float,
        Ge(0),
        Doc("How much the boxes grow on each side while the detector rests, in box sizes a second."),
    ] = 0.5
    mover_memory_s: Annotated[
        float,
        Ge(0),
        Doc("Seconds for which the last boxes are left out where no new ones come."),
    ] = 1.0
    mover_score: Annotated[
        float,
        Interval(ge=0, le=1),
        Doc("Boxes less sure than this are not left out."),
    ] = 0.25
