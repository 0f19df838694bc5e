"""Settings of the proximity stage."""

from dataclasses import dataclass
from typing import Annotated, Literal

from annotated_types import Ge, Gt, Interval, Len
from typing_extensions import Doc

from standoff.core.classes import CLASS_BY_NAME

SIDES = ("person", "equipment", "any", *CLASS_BY_NAME)


@dataclass(frozen=True, slots=True)
class ProximityParams:
    """Which pairs are measured and how outliers among the distances are treated."""

    pairs: Annotated[
        tuple[tuple[str, str], ...],
        Len(1),
        Doc(
            "Which pairs of tracks are measured. Each side is a class name, or 'person' or 'equipment' for all classes "
            "with that role, or 'any' for both roles. The order of the sides does not matter."
        ),
    ] = (("worker", "equipment"),)
    parked_after_s: Annotated[
        float | None,
        Ge(0),
        Doc(
            "A machine that has not moved for so many seconds is parked: near it there is no hazard until it moves. "
            "Never an excavator, which stands while it swings. null: no machine is ever parked."
        ),
    ] = 60.0
    cabs: Annotated[
        bool,
        Doc("Whoever stays within 2.5 m of a machine's middle while it drives 4 m is in its cab, and no hazard."),
    ] = True
    together: Annotated[
        tuple[tuple[int, int], ...],
        Doc("Pairs of track ids that work together, such as a banksman and a loader: no hazard."),
    ] = ()
    horizon_s: Annotated[
        float,
        Interval(ge=1, le=5),
        Doc("How far ahead it is asked whether two action radii will touch, in seconds."),
    ] = 3.0
    outlier_filter: Annotated[
        Literal["off", "paper"],
        Doc(
            "'paper': a distance further than the threshold from the mean of the previous two estimates is replaced by "
            "that mean, for ever if need be. 'off': places that cannot be are left out before, by the locate stage."
        ),
    ] = "off"
    outlier_threshold_px: Annotated[
        float | None, Gt(0), Doc("The paper's threshold, in pixels of its rectified plane (Eq. 6 makes metres of it).")
    ] = 50.0
    outlier_threshold_m: Annotated[
        float | None,
        Gt(0),
        Doc("The threshold in metres, in place of the one in pixels. Without either nothing is an outlier."),
    ] = None

    def __post_init__(self) -> None:
        for side in {side for pair in self.pairs for side in pair} - set(SIDES):
            raise ValueError(f"pairs: nothing is called {side!r}; there are {', '.join(SIDES)}")
