"""The nouns: one frozen struct of arrays for each arrow between two stages.

Arrays are copied and checked once, at construction, and are read-only afterwards. Boolean indexing
`rows[mask]` returns the same type. Nothing is ever None where an empty struct says the same.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime
from typing import ClassVar, Protocol

import numpy as np
import numpy.typing as npt

from standoff.core.classes import CLASS_BY_NAME
from standoff.core.clock import ToldBy as ToldBy
from standoff.core.durations import have_lasted
from standoff.core.ground_map import GroundMap as GroundMap
from standoff.core.ground_map import NoGroundMap as NoGroundMap
from standoff.core.hazards import Hazard as Hazard
from standoff.core.hazards import OpenHazards as OpenHazards
from standoff.core.hazards import Phase as Phase
from standoff.core.hazards import Severity as Severity
from standoff.core.homography import BoolArray, FloatArray
from standoff.core.motions import CameraMotion as CameraMotion
from standoff.core.motions import NoCameraMotion as NoCameraMotion
from standoff.core.outcome import Outcome as Outcome
from standoff.core.outcome import Silence as Silence
from standoff.core.roles import IS_EQUIPMENT
from standoff.core.rows import Columns, Rows
from standoff.core.telemetry import Telemetry
from standoff.core.watched_ground import WatchedGround as WatchedGround

IntArray = npt.NDArray[np.int64]
ImageArray = npt.NDArray[np.uint8]
TextArray = npt.NDArray[np.object_]

PARKED = "the machine is parked"
"""Why there is no hazard near a machine that has not moved for long."""
_EXCAVATOR = CLASS_BY_NAME["excavator"].id


class Luma(Protocol):
    """(H, W) uint8, made where it is looked at; an array is one, too."""

    @property
    def shape(self) -> tuple[int, ...]:
        """(H, W)."""
        ...

    def __getitem__(self, part: tuple[slice, slice], /) -> ImageArray:
        """Return some rows and columns."""
        ...


class Picture(Protocol):
    """The pixels of one frame, converted only when somebody asks, at the size that they ask for."""

    @property
    def width_px(self) -> int:
        """Width, known without converting."""
        ...

    @property
    def height_px(self) -> int:
        """Height, known without converting."""
        ...

    def bgr(self) -> ImageArray:
        """Return (H, W, 3) uint8, blue first; converted once and kept."""
        ...

    def resized_bgr(self, width_px: int, height_px: int) -> ImageArray:
        """Return (height_px, width_px, 3) uint8, blue first, without making the full-size picture."""
        ...

    def gray(self) -> ImageArray:
        """Return (H, W) uint8 luma; converted once and kept."""
        ...

    def luma(self) -> Luma:
        """Return what `gray` shows, for those who need little of it."""
        ...

    def halved_gray(self, times: int) -> ImageArray:
        """Return `gray` averaged over two by two pixels so many times, without making the full-size picture.

        An odd last row or column is dropped each time, so that all pixels have the same size.
        """
        ...


@dataclass(frozen=True, slots=True)
class Frame:
    """One picture of one stream.

    Attributes:
        stream_id: Name of the stream.
        index: Position in the source, counting every frame, also those that `every` skips.
        time_s: Presentation timestamp, seconds from the start of the source.
        captured_at: Aware UTC time of capture, or None when nobody tells.
        told_by: Who tells it; None with it.
        picture: The pixels.
        telemetry: What the drone said of itself at that moment; None: nothing.
    """

    stream_id: str
    index: int
    time_s: float
    picture: Picture
    captured_at: datetime | None = None
    told_by: ToldBy | None = None
    telemetry: Telemetry | None = None

    @property
    def image(self) -> ImageArray:
        """The full-size picture, (H, W, 3) uint8 BGR; asking for it converts it."""
        return self.picture.bgr()

    @property
    def size_px(self) -> tuple[int, int]:
        """(width, height), known without converting a pixel."""
        return self.picture.width_px, self.picture.height_px


_FOOT_COLUMNS: Columns = {"foot_px": (np.float64, (2,)), "foot_covariance_px2": (np.float64, (2, 2))}


def _check_feet(rows: Detections | Tracks) -> None:
    known = np.isfinite(rows.foot_px).all(axis=1)
    if not np.isnan(rows.foot_px[~known]).any(axis=1).all():
        raise ValueError(f"{type(rows).__name__}.foot_px must be finite or NaN")
    if not np.isfinite(rows.foot_covariance_px2[known]).all():
        raise ValueError(f"{type(rows).__name__}.foot_covariance_px2 must be finite where foot_px is")


@dataclass(frozen=True, slots=True, eq=False)
class Detections(Rows):
    """What the detector saw in one frame.

    Attributes:
        xyxy_px: (N, 4) left, top, right, bottom edges in full-size picture pixels.
        score: (N,) confidence, 0 to 1.
        class_id: (N,) ids of `standoff.core.classes.CLASSES`.
        foot_px: (N, 2) ground point: where the middle of the footprint appears, perhaps outside the picture; NaN where
            the model does not tell; left out: nowhere.
        foot_covariance_px2: (N, 2, 2) of `foot_px`; NaN with it.
    """

    xyxy_px: FloatArray
    score: FloatArray
    class_id: IntArray
    foot_px: FloatArray = field(default_factory=lambda: np.zeros((0, 2)))
    foot_covariance_px2: FloatArray = field(default_factory=lambda: np.zeros((0, 2, 2)))

    _COLUMNS: ClassVar[Columns] = {
        "xyxy_px": (np.float64, (4,)),
        "score": (np.float64, ()),
        "class_id": (np.int64, ()),
        **_FOOT_COLUMNS,
    }
    _OPTIONAL: ClassVar[frozenset[str]] = frozenset(_FOOT_COLUMNS)

    def __post_init__(self) -> None:
        Rows.__post_init__(self)
        _check_feet(self)
        if not np.isfinite(self.xyxy_px).all() or not np.isfinite(self.score).all():
            raise ValueError("Detections must be finite")
        if (self.xyxy_px[:, :2] > self.xyxy_px[:, 2:]).any():
            raise ValueError("Detections.xyxy_px must be left, top, right, bottom")
        if ((self.score < 0) | (self.score > 1)).any():
            raise ValueError("Detections.score must lie between 0 and 1")


@dataclass(frozen=True, slots=True, eq=False)
class Tracks(Rows):
    """Entities followed over time, as they are in one frame.

    Attributes:
        track_id: (M,) unique in its stream and never used again.
        xyxy_px: (M, 4) filtered box; predicted where not observed.
        score: (M,) of the last detection.
        class_id: (M,) ids of `CLASSES`.
        observed: (M,) False where the track coasts: no detection supports it in this frame.
        age_s: (M,) seconds since the track was first seen.
        foot_px: (M, 2) ground point, as in `Detections`, smoothed inside the box; predicted where not observed.
        foot_covariance_px2: (M, 2, 2) of `foot_px`; NaN with it.
    """

    track_id: IntArray
    xyxy_px: FloatArray
    score: FloatArray
    class_id: IntArray
    observed: BoolArray
    age_s: FloatArray
    foot_px: FloatArray = field(default_factory=lambda: np.zeros((0, 2)))
    foot_covariance_px2: FloatArray = field(default_factory=lambda: np.zeros((0, 2, 2)))

    _COLUMNS: ClassVar[Columns] = {
        "track_id": (np.int64, ()),
        "xyxy_px": (np.float64, (4,)),
        "score": (np.float64, ()),
        "class_id": (np.int64, ()),
        "observed": (np.bool_, ()),
        "age_s": (np.float64, ()),
        **_FOOT_COLUMNS,
    }
    _OPTIONAL: ClassVar[frozenset[str]] = frozenset(_FOOT_COLUMNS)

    def __post_init__(self) -> None:
        Rows.__post_init__(self)
        _check_feet(self)


@dataclass(frozen=True, slots=True, eq=False)
class GroundPositions(Rows):
    """Where each track stands; row i belongs to row i of the tracks it was made from.

    Attributes:
        track_id: (M,).
        class_id: (M,) ids of `CLASSES`.
        xy_m: (M, 2) site frame; NaN where invalid.
        velocity_mps: (M, 2) site frame; NaN while unknown.
        state_covariance: (M, 4, 4) of x, y in metres and vx, vy in metres per second, where the velocity is unknown of
            0 in its place, without the map's share; NaN where invalid.
        map_factor_m: (M, 2, 10) the map's share F: covariance F_i F_i^T, and F_i F_j^T between two entities,
            because all of a frame's positions lean on the same map; NaN where invalid.
        predicted: (M,) True where the position was not measured in this frame.
        standing_s: (M,) for how long it has not moved; NaN while unknown.
        radius_m: (M,) action radius.
        valid: (M,).
        reason: (M,) text; empty where valid.
    """

    track_id: IntArray
    class_id: IntArray
    xy_m: FloatArray
    velocity_mps: FloatArray
    state_covariance: FloatArray
    map_factor_m: FloatArray
    predicted: BoolArray
    standing_s: FloatArray
    radius_m: FloatArray
    valid: BoolArray
    reason: TextArray

    _COLUMNS: ClassVar[Columns] = {
        "track_id": (np.int64, ()),
        "class_id": (np.int64, ()),
        "xy_m": (np.float64, (2,)),
        "velocity_mps": (np.float64, (2,)),
        "state_covariance": (np.float64, (4, 4)),
        "map_factor_m": (np.float64, (2, 10)),
        "predicted": (np.bool_, ()),
        "standing_s": (np.float64, ()),
        "radius_m": (np.float64, ()),
        "valid": (np.bool_, ()),
        "reason": (np.object_, ()),
    }

    def __post_init__(self) -> None:
        Rows.__post_init__(self)
        if not np.isfinite(self.xy_m[self.valid]).all() or not np.isnan(self.xy_m[~self.valid]).all():
            raise ValueError("GroundPositions.xy_m must be finite where valid and NaN where not")

    @property
    def covariance_m2(self) -> FloatArray:
        """(M, 2, 2) of xy_m, the map's share included; NaN where invalid."""
        shared: FloatArray = self.map_factor_m @ self.map_factor_m.transpose(0, 2, 1)
        return self.state_covariance[:, :2, :2] + shared

    def parked(self, after_s: float | None) -> BoolArray:
        """Tell (M,) which machines have not moved for so many seconds.

        Never an excavator, which stands while it swings.

        Args:
            after_s: None: no machine is ever parked.
        """
        if after_s is None:
            return np.zeros(len(self), dtype=np.bool_)
        drives = IS_EQUIPMENT[self.class_id] & (self.class_id != _EXCAVATOR)
        return np.asarray(have_lasted(self.standing_s, after_s) & drives)


@dataclass(frozen=True, slots=True, eq=False)
class Proximities(Rows):
    """Every configured pair of tracks in the frame, measured or not.

    Attributes:
        track_a: (K,) the smaller track id.
        track_b: (K,) the larger one.
        distance_m: (K,) centre to centre; NaN where either position is invalid: not measured.
        gap_m: (K,) distance less both action radii; negative is a breach; NaN where not measured.
        sigma_m: (K,) standard error of the distance; NaN where not measured.
        closing_mps: (K,) > 0 approaching; NaN while unknown.
        time_to_contact_s: (K,) until gap_m is 0 at this closing speed, 0 when breached, inf if it never is;
            NaN while unknown.
        filtered: (K,) True where the outlier filter replaced the distance.
        closest_m: (K,) least distance of the likeliest paths within the horizon; NaN where not measured; as the three
            that follow, NaN also where nobody predicts.
        closest_in_s: (K,) seconds until then.
        breach_now: (K,) probability that the gap is negative.
        breach_ahead: (K,) probability that it is, or will be within the horizon.
        excuse: (K,) text, why the pair is no hazard however near; empty where it may be one.
    """

    track_a: IntArray
    track_b: IntArray
    distance_m: FloatArray
    gap_m: FloatArray
    sigma_m: FloatArray
    closing_mps: FloatArray
    time_to_contact_s: FloatArray
    filtered: BoolArray
    closest_m: FloatArray = field(default_factory=lambda: np.zeros(0))
    closest_in_s: FloatArray = field(default_factory=lambda: np.zeros(0))
    breach_now: FloatArray = field(default_factory=lambda: np.zeros(0))
    breach_ahead: FloatArray = field(default_factory=lambda: np.zeros(0))
    excuse: TextArray = field(default_factory=lambda: np.zeros(0, dtype=object))

    _COLUMNS: ClassVar[Columns] = {
        "track_a": (np.int64, ()),
        "track_b": (np.int64, ()),
        "distance_m": (np.float64, ()),
        "gap_m": (np.float64, ()),
        "sigma_m": (np.float64, ()),
        "closing_mps": (np.float64, ()),
        "time_to_contact_s": (np.float64, ()),
        "filtered": (np.bool_, ()),
        "closest_m": (np.float64, ()),
        "closest_in_s": (np.float64, ()),
        "breach_now": (np.float64, ()),
        "breach_ahead": (np.float64, ()),
        "excuse": (np.object_, ()),
    }
    _OPTIONAL: ClassVar[frozenset[str]] = frozenset(
        {"closest_m", "closest_in_s", "breach_now", "breach_ahead", "excuse"}
    )

    def __post_init__(self) -> None:
        Rows.__post_init__(self)
        if (self.track_a >= self.track_b).any():
            raise ValueError("Proximities.track_a must be smaller than track_b")


@dataclass(frozen=True, slots=True, eq=False)
class FrameResult:
    """Everything known of one frame: the only thing a sink or a service ever sees.

    Attributes:
        frame: The frame.
        detections: Empty on frames where the detector rested.
        detected: False on frames where the detector rested (`detect_every`).
        motion: How the picture of the ground moved, or why that is not known.
        ground: The map, or why there is none.
        tracks: Live tracks.
        positions: Row i belongs to track i.
        proximities: All configured pairs.
        hazards: The events of this frame.
        open_hazards: Which hazards are open after them.
        stage_ms: Milliseconds spent in each stage on this frame; in what a run yields those of its outputs, too
            ("sinks.NAME").
        unfollowed: (K,) which of the frame's sure detections no track shows; left out: there were none.
        watched: Where on the ground a worker would be found; left out: nobody judged.
    """

    frame: Frame
    detections: Detections
    detected: bool
    motion: CameraMotion | NoCameraMotion
    ground: GroundMap | NoGroundMap
    tracks: Tracks
    positions: GroundPositions
    proximities: Proximities
    hazards: tuple[Hazard, ...]
    stage_ms: Mapping[str, float]
    unfollowed: BoolArray = field(default_factory=lambda: np.zeros(0, dtype=np.bool_))
    watched: WatchedGround = field(default_factory=WatchedGround)
    open_hazards: OpenHazards = field(default_factory=OpenHazards)
