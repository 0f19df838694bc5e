"""Watches whether a map's metres are metres: people and machines seen through it must have their usual sizes."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from standoff.core import protocols
from standoff.core.camera import CameraPrior
from standoff.core.classes import Role, class_ids
from standoff.core.errors import GroundError
from standoff.core.protocols import AnyGround, AnyMotion, Ground
from standoff.core.types import Detections, Frame, GroundMap, NoGroundMap
from standoff.stages.ground.camera_check import lens_warnings
from standoff.stages.ground.size_scale import REFUSAL_FACTOR, WARNING_FACTOR, size_ratios, unit_hint

_EVERY_S = 0.5
_LEAST_SCORE = 0.6
_MOST_SIZES = 120
"""So many sizes of people, and as many of machines, are kept: what was seen last counts."""

_FEWEST_ENTITIES, _FEWEST_TO_WARN, _FEWEST_TO_REFUSE = 2, 3, 8
_ABSURD_FACTOR = 8.0
"""Beyond it no clutter is, and a point in the wrong place of a number is: as many as are enough to warn are enough to
refuse, as they are where both people and machines say so."""

_FITS = 2.5
"""Standard errors by which people and machines may differ and still speak for the same factor."""

_AGREED_SHARE = 0.75
"""So many of the sizes must be off by a factor, in one direction: some clutter passes for people, never so much."""

_GROUPS = {"people": Role.PERSON, "machines": Role.EQUIPMENT}


@dataclass(slots=True)
class _Sizes:
    """What was seen of people, or of machines: logarithms of how many times too large, and how many at once."""

    logs: deque[float]
    sigmas: deque[float]
    at_once: int = 0

    def log_likely(self) -> tuple[float, float]:
        """Return the factor of which most are nearest, as a logarithm, and the inverse of its variance."""
        return float(np.median(self.logs)), self.sigma**-2

    @property
    def sigma(self) -> float:
        """Standard error of what most are nearest to, with what all of a crew or a class share."""
        return float(np.median(self.sigmas))

    def log_factor(self) -> float:
        """Return the factor that most agree on, as a logarithm; 0 where they do not agree on a direction."""
        high, low = np.quantile(self.logs, [_AGREED_SHARE, 1.0 - _AGREED_SHARE])
        nearest = float(low if low > 0 else high if high < 0 else 0.0)
        # What all of a class or a crew share does not average out: at least two standard errors must remain.
        return nearest if abs(float(np.median(self.logs))) > 2.0 * self.sigma else 0.0


class ScaleWatch(protocols.Ground):
    """A ground stage around another one, which is told when its metres cannot be.

    Sizes off by a factor of 1.6 are a warning; by a factor of 4 there is no map. Both need sizes of several people or
    machines that agree. Where people and machines are both seen, the surer of the two tells the factor, unless the
    other contradicts it: a kind of machine may be much smaller than is usual, people hardly. To take the map away both
    have to be off.

    Args:
        inner: What finds the map.
        camera: The lens, where a map knows none; None: any drone's.
    """

    def __init__(self, inner: Ground, camera: CameraPrior | None = None) -> None:
        self.inner = inner
        self._camera = camera
        self._forget()

    def _forget(self) -> None:
        self._sizes = {name: _Sizes(deque(maxlen=_MOST_SIZES), deque(maxlen=_MOST_SIZES)) for name in _GROUPS}
        self._sampled_s = -np.inf
        self._refusal = ""
        self._warning, self._worst_log = "", 0.0
        self._impossible = ""

    def describe(self) -> dict[str, Any]:
        """Return the inner stage's, and what is odd about its lens and, by the sizes of what is seen, its metres."""
        inner = dict(self.inner.describe())
        inner["warnings"] = [*lens_warnings(self._camera), *inner.get("warnings", ()), *self._warnings()]
        seen = {name: len(sizes.logs) for name, sizes in self._sizes.items() if sizes.logs}
        ratios = {name: float(np.exp(np.median(sizes.logs))) for name, sizes in self._sizes.items() if sizes.logs}
        return {**inner, "scale_watch": {"sizes_seen": seen, "times_too_large": ratios}}

    def prepare(self, size_px: tuple[int, int]) -> None:
        """Make sure that the inner stage fits pictures of a size (width, height), before the first frame.

        Raises:
            GroundError: It does not.
        """
        self.inner.prepare(size_px)

    def reset(self) -> None:
        """Forget the stream, the inner stage's part of it as well."""
        self.inner.reset()
        self._forget()

    def update(self, frame: Frame, detections: Detections, motion: AnyMotion) -> AnyGround:
        """Return the inner stage's map, unless sizes say that its metres are none."""
        ground = self.inner.update(frame, detections, motion)
        if isinstance(ground, GroundMap):
            if len(detections) and not 0.0 <= frame.time_s - self._sampled_s < _EVERY_S:
                self._sampled_s = frame.time_s
                self._take(ground, detections)
                self._judge()
            if self._refusal:
                return NoGroundMap(self._refusal)
        return ground

    def _take(self, ground: GroundMap, detections: Detections) -> None:
        sure = detections[detections.score >= _LEAST_SCORE]
        try:
            log_ratio, sigma = size_ratios(_right_handed(ground), sure.xyxy_px, sure.class_id, self._camera)
        except GroundError as error:
            # The inner stage's points may fit it all the same.
            self._impossible = f"no camera above level ground sees the ground map so: {error.found}"
            return
        for name, role in _GROUPS.items():
            mine = np.isin(sure.class_id, class_ids(role)) & np.isfinite(log_ratio)
            sizes = self._sizes[name]
            sizes.logs.extend(log_ratio[mine].tolist())
            sizes.sigmas.extend(sigma[mine].tolist())
            sizes.at_once = max(sizes.at_once, int(mine.sum()))

    def _judge(self) -> None:
        log_factor, seen, at_once, of_both = self._agreed()
        of_all = of_both or sum(bool(sizes.logs) for sizes in self._sizes.values()) == 1
        enough = at_once >= _FEWEST_ENTITIES
        if enough and seen >= _FEWEST_TO_WARN and abs(log_factor) >= max(np.log(WARNING_FACTOR), self._worst_log):
            self._worst_log, self._warning = abs(log_factor), self._clause()
        sure = of_both or abs(log_factor) >= np.log(_ABSURD_FACTOR)
        fewest = _FEWEST_TO_WARN if sure else _FEWEST_TO_REFUSE
        if not (enough and of_all and seen >= fewest and abs(log_factor) >= np.log(REFUSAL_FACTOR)):
            self._refusal = ""
        elif not self._refusal:
            # The words stay the same as long as the cause does, so that it can be counted.
            self._refusal = self._clause()

    def _agreed(self) -> tuple[float, int, int, bool]:
        """Return the factor that all speak for, as a logarithm, by how many sizes, how many at once, and if by both."""
        groups = sorted((sizes for sizes in self._sizes.values() if sizes.logs), key=lambda sizes: sizes.sigma)
        if not groups:
            return 0.0, 0, 0, False
        surest, *others = groups
        log_factor = surest.log_factor()
        of_both = bool(others) and all(other.log_factor() * log_factor > 0 for other in others)
        for other in others:
            apart = abs(other.log_likely()[0] - surest.log_likely()[0])
            if apart > _FITS * float(np.hypot(other.sigma, surest.sigma)):
                log_factor = min(log_factor, other.log_factor(), key=abs) if of_both else 0.0
        return log_factor, sum(len(sizes.logs) for sizes in groups), sum(sizes.at_once for sizes in groups), of_both

    def _warnings(self) -> list[str]:
        sizes = f"seen through the ground map, {self._warning}" if self._warning else ""
        return [text for text in (sizes, self._impossible) if text]

    def _clause(self) -> str:
        """Say how large people and machines look, and which unit was probably meant."""
        groups = {name: sizes.log_likely() for name, sizes in self._sizes.items() if sizes.logs}
        weights = sum(weight for _, weight in groups.values())
        return _clause(sum(log * weight for log, weight in groups.values()) / weights, " and ".join(groups))


def _right_handed(ground: GroundMap) -> GroundMap:
    """Return the map with y to the left of x: metres that are mirrored are as long."""
    if np.linalg.det(ground.image_to_ground) <= 0:
        return ground
    return replace(ground, image_to_ground=np.diag([1.0, -1.0, 1.0]) @ ground.image_to_ground)


def _clause(log_factor: float, names: str) -> str:
    times = float(np.exp(abs(log_factor)))
    rounded = f"{times:.1f}" if times < 10 else f"{float(f'{times:.1g}'):,.0f}".replace(",", " ")
    unit = unit_hint(float(np.exp(log_factor)))
    cause = f"probably {unit}" if unit else "check the lengths that the ground is measured by"
    return f"{names} look {rounded} times too {'large' if log_factor > 0 else 'small'}: {cause}"
