"""Whether what the detector is sure of reaches the tracks at all: what no track shows has no distance to anything."""

from __future__ import annotations

from collections import deque

from standoff.core.homography import BoolArray
from standoff.core.types import Hazard
from standoff.core.unfollowed import are_many
from standoff.stages.hazard.latch import Latch, StreamHazard
from standoff.stages.hazard.params import HazardParams

NOT_FOLLOWED = "sure detections are in no track"
FOLLOWED_AGAIN = "sure detections are in tracks again"

_WINDOW_S = 3.0
_FEWEST_LOOKS = 3


class UnfollowedHazard(StreamHazard):
    """The hazard of a stream in which many sure detections belong to no track.

    Args:
        params: Settings; how long a state must hold before the hazard ends.
    """

    def __init__(self, params: HazardParams) -> None:
        super().__init__()
        self._lost = Latch(0.0, params.release_s)
        self._looks: deque[tuple[float, int, int]] = deque()
        self._opened = False
        self._unfollowed = self._sure = 0

    @property
    def warnings(self) -> list[str]:
        """What there is to say of the whole stream so far."""
        if not self._opened:
            return []
        return [f"{self._unfollowed} of {self._sure} sure detections are in no track: their distances are not known"]

    def update(self, time_s: float, unfollowed: BoolArray) -> Hazard | None:
        """Take which of the frame's sure detections (K,) are in no track, and return what there is to say."""
        if len(unfollowed):
            self._looks.append((time_s, int(unfollowed.sum()), len(unfollowed)))
            self._unfollowed += int(unfollowed.sum())
            self._sure += len(unfollowed)
        while len(self._looks) > _FEWEST_LOOKS and time_s - self._looks[0][0] > _WINDOW_S:
            self._looks.popleft()
        many = are_many(sum(count for _, count, _ in self._looks), sum(sure for _, _, sure in self._looks))
        self._lost.update(time_s, enters=many, leaves=not many)
        if not self._lost.on:
            return self.end(time_s, FOLLOWED_AGAIN)
        if self._hazard is not None:
            return None
        self._opened = True
        return self.begin(time_s, NOT_FOLLOWED)
