"""The closest approaches with their pictures; only as many as the report is going to show."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from standoff.core.hazards import Pair
from standoff.core.homography import FloatArray
from standoff.core.lengths import LengthUnit
from standoff.core.types import Frame, ImageArray
from standoff.stages.sinks.blurring import blur
from standoff.stages.sinks.frame_measurements import FrameMeasurements
from standoff.stages.sinks.overlay import Overlay
from standoff.stages.sinks.params import DrawParams
from standoff.stages.sinks.sketch import Sketch

_CLOSER_BY_M = 0.1
_ASPECT = 16 / 9
_SMALLEST_SHARE = 0.4
_MARGIN = 1.6
_DRAWN_WIDTH_PX = 800


@dataclass(frozen=True, slots=True)
class WorstMoment:
    """A pair at its closest so far.

    Attributes:
        names: What the two are called.
        time_s: Presentation timestamp.
        distance_m: Centre to centre.
        gap_m: Distance less both action radii.
        sigma_m: Standard error of the distance.
        severity: Of the pair's hazard at that time; empty without one.
        picture: (H, W, 3) uint8 BGR, a region of the frame.
        region_px: (4,) which region, in full-size pixels.
        measurements: What to draw over it.
    """

    names: tuple[str, str]
    time_s: float
    distance_m: float
    gap_m: float
    sigma_m: float
    severity: str
    picture: ImageArray
    region_px: FloatArray
    measurements: FrameMeasurements

    def jpeg(self, unit: LengthUnit) -> bytes:
        """Return the picture with the measurements drawn over it."""
        factor = max(1.0, _DRAWN_WIDTH_PX / self.picture.shape[1])
        drawn = cv2.resize(self.picture, None, fx=factor, fy=factor, interpolation=cv2.INTER_CUBIC).astype(np.uint8)
        params = DrawParams(size=1.5, legend=False)
        Overlay(params).draw(drawn, Sketch.of(self.measurements, params, unit), self.region_px)
        return cv2.imencode(".jpg", drawn, [cv2.IMWRITE_JPEG_QUALITY, 82])[1].tobytes()


class WorstMoments:
    """Keep the closest moment of each of the closest pairs.

    A kept picture is replaced when its pair comes closer by 0.1 m, not at every frame of an approach.

    Args:
        count: Most pairs kept.
        width_px: Width of the pictures.
    """

    def __init__(self, count: int, width_px: int) -> None:
        self._count, self._width_px = count, width_px
        self._kept: dict[Pair, WorstMoment] = {}

    def offer(self, frame: Frame, measurements: FrameMeasurements) -> None:
        """Keep this frame's pairs that are closer than what is kept. Outlier-filtered distances are passed over."""
        pairs = measurements.proximities
        measured = np.isfinite(pairs.gap_m) & ~pairs.filtered
        for k in np.flatnonzero(measured & (pairs.gap_m < self._limit_m())):
            pair = (int(pairs.track_a[k]), int(pairs.track_b[k]))
            earlier = self._kept.get(pair)
            if self._count and pairs.gap_m[k] < (earlier.gap_m - _CLOSER_BY_M if earlier else self._limit_m()):
                self._kept[pair] = self._moment(frame, measurements, int(k), pair)
            if len(self._kept) > self._count:
                del self._kept[max(self._kept, key=lambda key: self._kept[key].gap_m)]

    def _limit_m(self) -> float:
        return max(moment.gap_m for moment in self._kept.values()) if len(self._kept) >= self._count > 0 else np.inf

    def _moment(self, frame: Frame, measurements: FrameMeasurements, k: int, pair: Pair) -> WorstMoment:
        pairs, names = measurements.proximities, measurements.names()
        hazard = measurements.hazards.get(pair)
        boxes = measurements.tracks.xyxy_px[np.isin(measurements.tracks.track_id, pair)]
        picture, region = _around(frame, boxes, self._width_px)
        blur(picture, measurements.hidden_px, region)
        return WorstMoment(
            names=(names[pair[0]], names[pair[1]]),
            time_s=measurements.time_s,
            distance_m=float(pairs.distance_m[k]),
            gap_m=float(pairs.gap_m[k]),
            sigma_m=float(pairs.sigma_m[k]),
            severity=hazard.severity if hazard else "",
            picture=picture,
            region_px=region,
            measurements=measurements,
        )

    def worth_showing(self, below_m: float) -> list[WorstMoment]:
        """Return the moments with a gap below a limit, but at least the closest one, smallest gap first."""
        moments = sorted(self._kept.values(), key=lambda moment: moment.gap_m)
        return [moment for i, moment in enumerate(moments) if i == 0 or moment.gap_m < below_m]


def _around(frame: Frame, boxes_px: FloatArray, width_px: int) -> tuple[ImageArray, FloatArray]:
    """Return a copy of the region around boxes, at most `width_px` wide, and its edges in full-size pixels."""
    full = np.array(frame.size_px, dtype=np.float64)
    low, high = boxes_px[:, :2].min(axis=0), boxes_px[:, 2:].max(axis=0)
    wanted = max((high - low)[0], (high - low)[1] * _ASPECT) * _MARGIN
    wide = float(np.clip(wanted, _SMALLEST_SHARE * full[0], min(full[0], full[1] * _ASPECT)))
    size = np.array([wide, wide / _ASPECT])
    corner = np.clip((low + high) / 2.0 - size / 2.0, 0.0, full - size)
    factor = min(1.0, width_px / wide)
    picture = frame.picture.resized_bgr(*np.round(full * factor).astype(int).tolist()) if factor < 1 else frame.image
    x0, y0 = np.floor(corner * factor).astype(int)
    columns, rows = np.floor(size * factor).astype(int)
    cut = picture[y0 : y0 + rows, x0 : x0 + columns].copy()
    edges = np.array([x0, y0, x0 + cut.shape[1], y0 + cut.shape[0]]) / factor
    return cut, edges
