"""Settings of the hazard stage."""

from dataclasses import dataclass, fields
from typing import Annotated, Literal

from annotated_types import Ge, Interval
from typing_extensions import Doc


@dataclass(frozen=True, slots=True)
class HazardParams:
    """How near is too near, for how long, and when to say so.

    The gap is the distance less both action radii, so it is danger when it is negative: the circles touch.
    """

    rule: Annotated[
        Literal["probability", "distance"],
        Doc(
            "'probability': a warning when the circles will likely touch within the horizon (`proximity.horizon_s`), "
            "danger when they likely do now. 'distance', the paper's: a warning when the gap is less than `buffer_m`, "
            "danger when it is negative."
        ),
    ] = "probability"
    warning_probability: Annotated[
        float,
        Interval(gt=0, lt=1),
        Doc(
            "How likely a breach within the horizon must be for a warning. Of 18 breaches on simulated ordinary sites "
            "17 were told one second before at 0.3, and 13 of them two: see docs/accuracy.md."
        ),
    ] = 0.3
    danger_probability: Annotated[float, Interval(gt=0, lt=1), Doc("How likely a breach now must be for danger.")] = 0.5
    buffer_m: Annotated[
        float,
        Ge(0),
        Doc(
            "By distance, warn when the gap is less than so many metres; the paper's suggestion to absorb the "
            "measurement error."
        ),
    ] = 1.0
    zone_warn_m: Annotated[
        float,
        Ge(0),
        Doc("Warn when somebody is nearer than so many metres to a zone that he must not be in; inside is danger."),
    ] = 1.0
    caution_sigmas: Annotated[
        float,
        Ge(0),
        Doc(
            "By distance, take the gap to be smaller by so many of its standard errors; 0 takes it as measured, as the "
            "paper does."
        ),
    ] = 0.0
    hysteresis_m: Annotated[
        float,
        Ge(0),
        Doc(
            "By distance, a level ends when the gap exceeds its limit by so many metres: noise of half a metre does "
            "not flicker."
        ),
    ] = 0.5
    min_duration_s: Annotated[
        float,
        Ge(0),
        Doc(
            "A level must hold so many seconds before it is said: one bad frame is no alarm. 0 says it at once, and so "
            "is said who is inside beyond doubt when first measured."
        ),
    ] = 0.2
    release_s: Annotated[float, Ge(0), Doc("The gap must be wide enough for so many seconds before a level ends.")] = (
        0.5
    )
    least_watched_share: Annotated[
        float,
        Interval(ge=0, le=1),
        Doc(
            "Where less than this share of the ground in the picture is watched, that is said, until it is twice as "
            "much: silence is no safety."
        ),
    ] = 0.05
    update_every_s: Annotated[
        float, Ge(0), Doc("While a hazard lasts it is reported again every so many seconds, and at every change.")
    ] = 1.0
    unknown_after_s: Annotated[
        float,
        Ge(0),
        Doc(
            "A visible pair that was not near when last measured opens a hazard of unknown severity when it cannot be "
            "measured for so many seconds: about what a walker needs to come into the picture whole."
        ),
    ] = 1.0
    unknown_timeout_s: Annotated[
        float, Ge(0), Doc("A hazard whose pair is no longer followed stays unknown for so many seconds, then closes.")
    ] = 3.0

    def __post_init__(self) -> None:
        for setting in fields(self):
            value = getattr(self, setting.name)
            # Not a bound to be left to the configuration: no gap is less than NaN, so it would switch the alarm off.
            if not isinstance(value, str) and not value >= 0:
                raise ValueError(f"{setting.name} must be a number from 0, not {value}")
