"""Watch for the markers of a site, frame after frame, for little time: near where they were last, or should be."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Self

import numpy as np

from standoff.core.errors import GroundError
from standoff.core.homography import FloatArray
from standoff.core.pose import View
from standoff.core.types import ImageArray
from standoff.stages.ground.marker_family import MarkerFamily, marker_pattern
from standoff.stages.ground.marker_place import MarkerPlace
from standoff.stages.ground.markers import Markers, find_markers
from standoff.stages.ground.observation import PointObservation

NO_MARKER = "no marker has been seen"

_SEARCH_EVERY_S = 1.0
_SIDES_AROUND = 0.75
_WIDTH_SHARE_AROUND = 0.012
_MISSES_BEFORE_LOST = 4
"""Each miss widens the margin around the last place by half; after so many the marker counts as lost."""


class MarkerObserver:
    """Finds markers of known places in one stream.

    Where a marker was seen before, or where a guess of the camera's pose puts it, only a window is searched. The whole
    picture is searched once a second, and only while no marker at all is in sight.

    Args:
        places: Which markers lie where.
        family: Of all of them.

    Raises:
        GroundError: No marker, two places for one marker, or an id that the family does not have.
    """

    def __init__(self, places: Sequence[MarkerPlace], family: MarkerFamily = "apriltag36h11") -> None:
        if not places:
            raise GroundError(expected="at least one marker's place", found="none", fix="give the place of a marker")
        self._places = {place.marker_id: place for place in places}
        if len(self._places) < len(places):
            raise GroundError(
                expected="one place for each marker", found="an id that occurs twice", fix="print each marker once only"
            )
        for place in places:
            marker_pattern(family, place.marker_id)
        self._family: MarkerFamily = family
        self.reset()

    @property
    def places(self) -> tuple[MarkerPlace, ...]:
        """Which markers lie where."""
        return tuple(self._places.values())

    def at(self, places: Sequence[MarkerPlace]) -> Self:
        """Return the same watch over markers that lie elsewhere."""
        return type(self)(places, self._family)

    def reset(self) -> None:
        """Forget where markers were seen: another film begins."""
        self._last_px: dict[int, FloatArray] = {}
        self._misses: dict[int, int] = {}
        self._searched_s: float | None = None

    def observe(
        self, gray: ImageArray, guess: View | None = None, time_s: float | None = None
    ) -> list[PointObservation]:
        """Look for the markers in one frame.

        Args:
            gray: (H, W) uint8, as seen.
            guess: About where the camera is, for pictures of this size; None if nobody knows.
            time_s: The frame's presentation timestamp; None: the whole picture is searched in each frame in which
                no marker is in sight.

        Returns:
            One for each marker seen, named "marker ID", with its four corners; empty where none is seen.
        """
        found: dict[int, PointObservation] = {}
        for marker_id in self._places:
            window = self._window(marker_id, gray, guess)
            if window is not None:
                self._search(gray, window, {marker_id}, found)
                self._note(marker_id, marker_id in found)
        if not found and self._search_is_due(time_s):
            self._search(gray, (0, 0, gray.shape[1], gray.shape[0]), set(self._places), found)
            self._searched_s = time_s
        return [found[marker_id] for marker_id in self._places if marker_id in found]

    def _search_is_due(self, time_s: float | None) -> bool:
        last_s = self._searched_s
        return time_s is None or last_s is None or not last_s <= time_s < last_s + _SEARCH_EVERY_S

    def _note(self, marker_id: int, seen: bool) -> None:
        self._misses[marker_id] = 0 if seen else self._misses.get(marker_id, 0) + 1
        if self._misses[marker_id] > _MISSES_BEFORE_LOST:
            self._last_px.pop(marker_id, None)

    def _window(self, marker_id: int, gray: ImageArray, guess: View | None) -> tuple[int, int, int, int] | None:
        """Return left, top, right, bottom of where to look for one marker; None where nothing says so."""
        corners_px = self._last_px.get(marker_id)
        if corners_px is None:
            corners_px = None if guess is None else guess.project(self._places[marker_id].corners_m)
        if corners_px is None or not np.isfinite(corners_px).all():
            return None
        low, high = corners_px.min(axis=0), corners_px.max(axis=0)
        margin_px = _SIDES_AROUND * float((high - low).max()) + _WIDTH_SHARE_AROUND * gray.shape[1]
        margin_px *= 1.5 ** min(self._misses.get(marker_id, 0), _MISSES_BEFORE_LOST)
        size = np.array(gray.shape[::-1], dtype=np.float64)
        low, high = np.clip(low - margin_px, 0.0, size), np.clip(high + margin_px, 0.0, size)
        if (high <= low).any():
            return None
        left, top, right, bottom = (int(edge) for edge in (*np.floor(low), *np.ceil(high)))
        return left, top, right, bottom

    def _search(
        self, gray: ImageArray, window: tuple[int, int, int, int], wanted: set[int], found: dict[int, PointObservation]
    ) -> None:
        left, top, right, bottom = window
        lasts = [self._last_px[one] for one in wanted if one in self._last_px]
        expected_px = min((float(np.linalg.norm(np.diff(one, axis=0), axis=1).min()) for one in lasts), default=None)
        cut = np.ascontiguousarray(gray[top:bottom, left:right])
        markers = find_markers(cut, self._family, wanted=wanted, expected_px=expected_px)
        shifted = Markers(markers.ids, markers.corners_px + np.array([left, top]), markers.sigma_px)
        for marker_id, corners_px, sigma_px in zip(
            shifted.ids.tolist(), shifted.corners_px, shifted.sigma_px, strict=True
        ):
            self._last_px[marker_id] = corners_px
            self._misses[marker_id] = 0
            found[marker_id] = PointObservation(
                f"marker {marker_id}", self._places[marker_id].corners_m, corners_px, sigma_px
            )
