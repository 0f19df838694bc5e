"""Settings of the locate stage."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Literal

from annotated_types import Ge, Interval
from typing_extensions import Doc

from standoff.core.classes import CLASS_BY_NAME

Anchor = Literal["ground_point", "bottom_centre", "box_centre"]


@dataclass(frozen=True, slots=True)
class LocateParams:
    """Which point of a box stands for the entity, how sure it is, and how far the entity reaches."""

    anchor: Annotated[
        Anchor,
        Doc(
            "The point that is taken to stand on the ground. ground_point: the detector's own, or where it gives none "
            "the place where things of the class usually stand in boxes seen at this angle, with the error that a box "
            "leaves open. bottom_centre: of the box; a machine's near side, with no error for that. box_centre: the "
            "paper's, which places a tall entity behind where it stands."
        ),
    ] = "ground_point"
    edge_sigma_fraction: Annotated[
        float,
        Ge(0),
        Doc(
            "Standard error of one edge of a box, as a fraction of the side that crosses it. Four edges each off by "
            "6 % on their own give the paper's average IoU of 0.81 (Table 2): 1 - 4 x 0.8 x 0.06."
        ),
    ] = 0.06
    edge_sigma_floor_px: Annotated[
        float, Ge(0), Doc("Least standard error of one edge of a box, in pixels, however small the box.")
    ] = 1.0
    smooth: Annotated[
        bool,
        Doc(
            "Places are smoothed on the ground as things of the class move; off, each frame's own place counts, as in "
            "the paper."
        ),
    ] = True
    predict_s: Annotated[
        float,
        Ge(0),
        Doc(
            "Where a track was not seen, or not well enough to be located, its place is predicted for so many seconds, "
            "with an error that grows; then it is unknown."
        ),
    ] = 1.0
    white_share: Annotated[
        float,
        Interval(gt=0, le=1),
        Doc(
            "Share of the variance of a point in the picture that is another in every frame and averages out; the "
            "rest stays with a track."
        ),
    ] = 0.3
    relief_sigma_m: Annotated[
        float,
        Ge(0),
        Doc(
            "Standard deviation of the ground's height about the plane of the map, where things stand. Surveyed "
            "heights take its place."
        ),
    ] = 0.1
    cut_off_margin_px: Annotated[
        float,
        Ge(0),
        Doc(
            "A box that comes this near to the picture's edge, in pixels, or within two standard errors of its own "
            "edge, may go on outside: it is not located."
        ),
    ] = 1.5
    horizon_sigmas: Annotated[
        float,
        Ge(0),
        Doc(
            "A point less than this many standard errors below the horizon is not located. At 3 the distance from "
            "the camera is good to a third; nearer the horizon no covariance describes the error."
        ),
    ] = 3.0
    radius_m: Annotated[
        Mapping[str, float],
        Doc("Action radius in metres by class name, in place of the class's own."),
    ] = field(default_factory=dict)
    track_radius_m: Annotated[
        Mapping[int, float],
        Doc("Action radius in metres by track id, in place of the one by class."),
    ] = field(default_factory=dict)

    def __post_init__(self) -> None:
        unknown = sorted(set(self.radius_m) - set(CLASS_BY_NAME))
        if unknown:
            raise ValueError(f"radius_m: no class is called {', '.join(unknown)}; there are {', '.join(CLASS_BY_NAME)}")
        for name, radius_m in [*self.radius_m.items(), *self.track_radius_m.items()]:
            if not 0 <= radius_m < float("inf"):
                raise ValueError(f"the action radius of {name} must be a number of metres from 0, not {radius_m}")
