"""Settings of the watched ground."""

from dataclasses import dataclass
from typing import Annotated

from annotated_types import Ge, Gt, Interval
from typing_extensions import Doc


@dataclass(frozen=True, slots=True)
class WatchedParams:
    """Where a worker would be found, and in which pictures.

    What a picture must be like was chosen on 80 validation pictures of rendered sites, made worse by blur, motion, fog,
    dusk and noise, so that workers over 30 px are found about as often as in the pictures as they were.
    """

    stature_m: Annotated[float, Gt(0), Doc("How tall the people are who must be found.")] = 1.7
    found_share: Annotated[
        float,
        Interval(gt=0, lt=1),
        Doc(
            "Ground is watched where this share of workers, as tall as they would appear there, is in a track or at "
            "least suspected (`suspect_score`)."
        ),
    ] = 0.9
    suspect_score: Annotated[
        float,
        Interval(ge=0, le=1),
        Doc(
            "Where the detector is so sure of a worker, and no track shows him, somebody may stand: the ground is not "
            "watched, and near a machine it is a hazard of unknown severity. 1 is never."
        ),
    ] = 0.2
    suspect_s: Annotated[float, Ge(0), Doc("For so long after it was seen.")] = 2.0
    suspect_radius_m: Annotated[float, Gt(0), Doc("So far around.")] = 1.5
    largest_sigma_m: Annotated[
        float, Gt(0), Doc("And where the map places them with no more than this standard error.")
    ] = 1.0
    largest_blur_px: Annotated[
        float,
        Gt(0),
        Doc("Standard deviation of blur, in pixels of what the detector sees, above which a picture is blurred."),
    ] = 2.4
    least_contrast: Annotated[
        float,
        Ge(0),
        Doc("Range of grey as a share of the mean grey, below which there is fog, or something on the lens."),
    ] = 0.25
    least_signal: Annotated[
        float,
        Ge(0),
        Doc("Range of grey in standard deviations of the noise, below which it is too dark."),
    ] = 13.0
    judge_every_s: Annotated[
        float, Ge(0), Doc("The picture and the map are judged anew after so many seconds, machines in every frame.")
    ] = 0.5
