"""Settings of the tracker."""

from dataclasses import dataclass
from typing import Annotated

from annotated_types import Ge, Gt, Interval
from typing_extensions import Doc


@dataclass(frozen=True, slots=True)
class TrackParams:
    """How detections become tracks.

    Lengths are in box sizes, the geometric mean of a box's width and height, so that near and far,
    worker and machine need no settings of their own. The defaults were chosen on frames 388-554 of PETS
    2009 with a small COCO detector, at 10, 5 and 2 frames a second; all but `start_score` lie on plateaus.
    """

    high_score: Annotated[
        float,
        Interval(ge=0, le=1),
        Doc("Detections at least this sure are assigned to tracks first."),
    ] = 0.4
    low_score: Annotated[
        float,
        Interval(ge=0, le=1),
        Doc("Less sure ones, down to this, carry on tracks that no sure one fits better. Not above high_score."),
    ] = 0.1
    start_score: Annotated[
        float,
        Interval(ge=0, le=1),
        Doc("A detection must be this sure to start a track. Not below high_score. Clutter rarely reaches 0.6."),
    ] = 0.6
    min_overlap: Annotated[
        float,
        Interval(gt=0, le=1),
        Doc("Smallest overlap (IoU of the widened boxes) of a sure detection with the track that it continues."),
    ] = 0.1
    min_overlap_unsure: Annotated[
        float,
        Interval(gt=0, le=1),
        Doc("The same for an unsure detection: stricter, because most of those are clutter."),
    ] = 0.3
    margin: Annotated[
        float,
        Interval(ge=0, le=2),
        Doc("Boxes are widened on each side by this share before they are compared, for few frames a second."),
    ] = 0.2
    duplicate_overlap: Annotated[
        float,
        Interval(gt=0, le=1),
        Doc("Of two boxes of different machine classes that overlap this much, only the surer one counts."),
    ] = 0.7
    confirm_hits: Annotated[
        int,
        Ge(1),
        Doc("Detections in a row before a track is reported; those of a stream's first frame are reported at once."),
    ] = 2
    rare_look_s: Annotated[
        float,
        Ge(0),
        Doc("Where the last look was longer ago, tracks go on over the ground, and a new one is reported at once."),
    ] = 0.25
    person_speed_mps: Annotated[
        float,
        Gt(0),
        Doc("How fast people run: where boxes no longer overlap, nobody is looked for further away on the ground."),
    ] = 4.0
    machine_speed_mps: Annotated[
        float,
        Gt(0),
        Doc("How fast machines drive, for the same."),
    ] = 8.0
    place_slack_m: Annotated[
        float,
        Ge(0),
        Doc("How far a place on the ground may be off besides, for the same."),
    ] = 1.0
    max_coast_s: Annotated[
        float,
        Ge(0),
        Doc("Seconds that a track which the detector misses is still reported, marked as not observed."),
    ] = 0.5
    max_lost_s: Annotated[
        float,
        Ge(0),
        Doc("Seconds until a missed track ends, max_coast_s at least; before, it can come back under its id."),
    ] = 1.0
    max_unsure_s: Annotated[
        float,
        Ge(0),
        Doc("Seconds that unsure detections alone carry a track on; people behind a post reappear sooner."),
    ] = 2.0
    box_noise: Annotated[
        float,
        Gt(0),
        Doc("Standard error of a detected box's centre, width and height, in box sizes."),
    ] = 0.1
    acceleration_noise: Annotated[
        float,
        Gt(0),
        Doc("How much the velocity of a box wanders in a second, in box sizes per second."),
    ] = 0.7
    size_drift: Annotated[
        float,
        Gt(0),
        Doc("How much width and height wander in a second, in box sizes."),
    ] = 0.05
    foot_memory_s: Annotated[
        float,
        Gt(0),
        Doc("A ground point is a mean of those of the last moments: after so many seconds one weighs a third."),
    ] = 0.4
    start_speed: Annotated[
        float,
        Gt(0),
        Doc("Standard deviation of a new track's unknown velocity, in box sizes per second."),
    ] = 1.5

    def __post_init__(self) -> None:
        if self.low_score > self.high_score:
            raise ValueError(f"low_score ({self.low_score}) must not exceed high_score ({self.high_score})")
        if self.start_score < self.high_score:
            raise ValueError(f"start_score ({self.start_score}) must not be below high_score ({self.high_score})")
