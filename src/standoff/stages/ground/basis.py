"""What a run's metres rest on, in words, and what would make them better."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence

import numpy as np

from standoff.core.camera import CameraPrior
from standoff.stages.ground.marker_place import MarkerPlace
from standoff.stages.ground.shape import ReferenceShape

_EQUAL = 1e-6

HELP = "a printed marker, a reference object of known size or the drone's log beside the film would help"


def lens_text(camera: CameraPrior | None) -> str:
    """Say where the lens is from."""
    return f"its camera's lens from {_origin(camera)}"


def _origin(camera: CameraPrior | None) -> str:
    if camera is None:
        return "a drone's usual lens"
    return "a camera file" if camera.origin == "camera file" else camera.origin


def reference_basis(shape: ReferenceShape) -> str:
    """Say which reference object, with its size.

    >>> reference_basis(ReferenceShape.square(2.89)), reference_basis(ReferenceShape.rectangle(2.4, 3.0))
    ('a square reference of 2.89 m', 'a rectangular reference of 2.4 by 3 m')
    >>> reference_basis(ReferenceShape.regular(6, 1.5))
    'a reference with 6 sides of 1.5 m'
    """
    corners, sides = shape.corners_m, shape.sides_m
    uneven = f"a reference with sides of {', '.join(f'{side:.4g}' for side in sides)} m"
    if len(corners) != 4:
        is_regular = len(shape.turns_onto_itself()) == len(corners)
        return f"a reference with {len(sides)} sides of {sides[0]:.4g} m" if is_regular else uneven
    diagonals = np.linalg.norm(corners[2:] - corners[:2], axis=1)
    if np.ptp(diagonals) > _EQUAL or np.abs(sides[:2] - sides[2:]).max() > _EQUAL:
        return uneven
    if np.ptp(sides) < _EQUAL:
        return f"a square reference of {sides[0]:.4g} m"
    return f"a rectangular reference of {sides[0]:.4g} by {sides[1]:.4g} m"


def markers_basis(places: Sequence[MarkerPlace]) -> str:
    """Say which markers, with their sizes.

    >>> markers_basis([MarkerPlace.lying(0, 1.2)])
    'a printed marker of 1.2 m'
    """
    sizes = sorted({round(place.size_m, 3) for place in places})
    text = " and ".join(f"{size:g}" for size in sizes)
    return f"a printed marker of {text} m" if len(places) == 1 else f"{len(places)} printed markers of {text} m"


BETTER: Mapping[str, str] = {
    "reference": "a larger reference, its height above the ground, and a camera file make it better",
    "survey": "more points, spread over the whole picture, and a camera file make it better",
    "markers": "a camera file, and a second marker far from the first, make it better",
    "telemetry": "a printed marker or a reference object of known size makes it better",
    "sizes": "a printed marker, a reference object of known size or the drone's log makes it better",
}
"""What would make the lengths better, by what found the most maps."""


def expectation(sigma: float) -> str:
    """Say how far off lengths will be, by their relative standard error.

    >>> expectation(0.117)
    'expect 12 %'
    """
    return f"expect {max(100.0 * sigma, 1.0):.0f} %"


class BasisTally:
    """Counts by what the frames of one stream were mapped, and how well.

    Args:
        shapes: Of the references.
        places: Of the markers.
        surveyed: How many points were surveyed.

    Attributes:
        most_people: That were measured by at once.
        why_none: The last reason for which there was no map.
    """

    def __init__(self, shapes: Sequence[ReferenceShape], places: Sequence[MarkerPlace], surveyed: int) -> None:
        self._shapes, self._places, self._surveyed = shapes, places, surveyed
        self._maps: Counter[str] = Counter()
        self._sigmas: dict[str, float] = defaultdict(float)
        self.most_people = 0
        self.why_none = ""

    def count(self, source: str, sigma: float) -> None:
        """Count a map, whose lengths have a relative standard error."""
        self._maps[source] += 1
        self._sigmas[source] += sigma

    def text(self, camera: CameraPrior | None) -> str:
        """Say what the metres of the frames so far rest on."""
        if self._maps:
            return "; ".join(f"{self._text(one, camera)}: {self._expected(one)}" for one, _ in self._maps.most_common())
        if self.why_none:
            return f"nothing: {self.why_none}"
        given = {"survey": self._surveyed, "reference": self._shapes, "markers": self._places}
        stated = [source for source, told in given.items() if told]
        told = " and ".join(self._text(one, camera) for one in stated)
        return f"{told}, not seen yet" if told else "not known before the first frame"

    @property
    def better(self) -> str:
        """What would make them better."""
        return BETTER[self._maps.most_common(1)[0][0]] if self._maps else HELP

    def _text(self, source: str, camera: CameraPrior | None) -> str:
        if source == "survey":
            return f"{self._surveyed} surveyed points, {lens_text(camera)}"
        if source == "reference":
            return f"{' and '.join(map(reference_basis, self._shapes))}, {lens_text(camera)}"
        if source == "markers":
            return f"{markers_basis(self._places)}, {lens_text(camera)}"
        return "the drone's telemetry" if source == "telemetry" else f"the height of {self.most_people} people"

    def _expected(self, source: str) -> str:
        share = f" in {self._maps[source]} of {self._maps.total()} frames with a map" if len(self._maps) > 1 else ""
        return expectation(self._sigmas[source] / self._maps[source]) + share
