"""A finished run, read as far as somebody looks at it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from standoff.clips.columns import Columns
from standoff.clips.ground_maps import MAP_COLUMNS, map_of
from standoff.clips.run_folder import RunFolder, RunTable
from standoff.core.errors import ConfigError, DataError
from standoff.core.hazard_life import HazardLife
from standoff.core.hazards import Severity, worse
from standoff.core.homography import FloatArray
from standoff.core.lengths import UNITS
from standoff.core.outputs import OUTPUTS, ZONES_FILE
from standoff.core.protocols import AnyGround
from standoff.core.types import GroundMap, NoGroundMap
from standoff.core.zones import Zone
from standoff.files.zone_file import read_zones
from standoff.service.review.answers import CurvesAnswer, FrameAt, PairAt, Pixel, TrackAt

LONGEST_SPAN_S: Final = 10.0
"""Of frames that are asked for at once."""
_CURVE_POINTS: Final = 1200
_NEAR_M: Final = 25.0
_MOST_PAIRS: Final = 8
"""Lines between those further apart, or of more pairs in one picture, are only in the way."""
_TURNS: Final = np.linspace(0.0, 2.0 * np.pi, 25)
_CIRCLE: Final = np.column_stack([np.cos(_TURNS), np.sin(_TURNS)])
_OUTLIERS: Final = (1.0, 99.0)
"""Per cent of places that the plan need not show."""
_PLACES: Final = 50_000
"""So many are enough to know what those are."""
_PLAN_MARGIN_M: Final = 1.0

_TRACKS: Final = (
    "frame", "track_id", "class", "x1_px", "y1_px", "x2_px", "y2_px", "observed", "x_m", "y_m", "radius_m", "valid",
    "vx_mps",
)  # fmt: skip
_PAIRS: Final = ("frame", "track_a", "track_b", "distance_m", "gap_m", "sigma_m", "filtered")
_FRAMES: Final = ("frame", "time_s", "watched_share", *(name for name, *_ in MAP_COLUMNS))


class FinishedRun:
    """The folder of a run: its record and hazards at once, of its tables what is asked for.

    Args:
        folder: Of the run.

    Raises:
        DataError: It is none, or broken.

    Attributes:
        folder: Of the run.
        record: What it says of itself.
        size_px: (width, height) of its pictures.
        unit: What its lengths are said in.
        lives: Its hazards, in the order in which they opened.
        missing: Names of tables and events that it did not keep.
        first_s: Time of its first frame.
        last_s: Of its last.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._files = RunFolder(folder)
        self.record = self._files.record()
        if not self.record:
            raise DataError(
                expected=f"the folder of a run at {folder}", found="no run.json in it", fix="name what --out was"
            )
        source, settings = self.record.get("source") or {}, self.record.get("settings") or {}
        width_px, height_px = source.get("size_px") or (0, 0)
        self.size_px = (int(width_px), int(height_px))
        self.unit = UNITS[(settings.get("show") or {}).get("unit", "metres")]
        kept = {name for name in ("tracks", "proximity", "frames", "hazards") if (folder / OUTPUTS[name]).is_file()}
        self.missing = sorted({"tracks", "proximity", "frames", "hazards"} - kept)
        self.lives: list[HazardLife] = self._files.hazard_lives() if "hazards" in kept else []
        times_s = self._whole("frames", ("time_s",))["time_s"]
        self.first_s, self.last_s = (float(times_s[0]), float(times_s[-1])) if len(times_s) else (0.0, 0.0)

    def zones(self) -> tuple[Zone, ...]:
        """Return the zones of its site.

        Raises:
            ConfigError: Their file is broken.
        """
        path = self.folder / ZONES_FILE
        return read_zones(path) if path.is_file() else ()

    def bounds_m(self) -> tuple[float, float, float, float] | None:
        """Return the least x and y and the largest of where anybody was; None where nobody was placed."""
        tracks = self._whole("tracks", ("x_m", "y_m", "radius_m"))
        known = np.isfinite(tracks["x_m"]) & np.isfinite(tracks["y_m"])
        if not known.any():
            return None
        some = np.flatnonzero(known)[:: max(1, int(known.sum()) // _PLACES)]
        places_m = np.column_stack([tracks["x_m"][some], tracks["y_m"][some]])
        radius_m = tracks["radius_m"][some, None]
        left, low = np.percentile(places_m - radius_m, _OUTLIERS[0], axis=0).tolist()
        right, high = np.percentile(places_m + radius_m, _OUTLIERS[1], axis=0).tolist()
        return left - _PLAN_MARGIN_M, low - _PLAN_MARGIN_M, right + _PLAN_MARGIN_M, high + _PLAN_MARGIN_M

    def curves(self) -> CurvesAnswer:
        """Return the least gap and the least watched share over the run, in a bounded number of spans.

        Raises:
            DataError: A table is broken.
        """
        pairs, frames = (
            self._whole("proximity", ("time_s", "gap_m")),
            self._whole("frames", ("time_s", "watched_share")),
        )
        edges_s = np.unique(frames["time_s"].astype(np.float64))
        if len(edges_s) > _CURVE_POINTS:
            edges_s = np.linspace(self.first_s, self.last_s, _CURVE_POINTS, endpoint=False)
        gaps = _least(edges_s, pairs["time_s"], pairs["gap_m"] / self.unit.in_m)
        watched = _least(edges_s, frames["time_s"], frames["watched_share"])
        return CurvesAnswer(time_s=edges_s.tolist(), gap=_known(gaps), watched=_known(watched))

    def frames(self, from_s: float, to_s: float) -> list[FrameAt]:
        """Return what there is to draw over the frames of a short span.

        Raises:
            ConfigError: It is longer than `LONGEST_SPAN_S`.
            DataError: A table is broken.
        """
        if not 0.0 <= to_s - from_s <= LONGEST_SPAN_S:
            raise ConfigError(
                expected=f"a span of up to {LONGEST_SPAN_S:.0f} s", found=f"{to_s - from_s:.1f} s", fix="ask for less"
            )
        span_s = from_s, to_s
        frames = self._rows("frames", _FRAMES, span_s)
        tracks = _by_frame(self._rows("tracks", _TRACKS, span_s))
        pairs = _by_frame(self._rows("proximity", _PAIRS, span_s))
        lives = [life for life in self.lives if life.opened_s <= to_s and not (life.closed_s or math.inf) < from_s]
        found: list[FrameAt] = []
        before: Sequence[dict[str, Any]] = ()
        for frame in frames:
            now = tracks.get(frame["frame"], ())
            found.append(self._frame(frame, now, pairs.get(frame["frame"], ()), lives, is_moved=_is_moved(before, now)))
            before = now
        return found

    def _frame(
        self, frame: dict[str, Any], tracks: Sequence[dict[str, Any]], pairs: Sequence[dict[str, Any]],
        lives: Sequence[HazardLife], *, is_moved: bool,
    ) -> FrameAt:  # fmt: skip
        time_s = float(frame["time_s"])
        ground = self._map(frame)
        # The end of the run closes what is open at its last frame, which was no less grave for that.
        asked_s = time_s if time_s < self.last_s else math.nextafter(time_s, -math.inf)
        worst: dict[int, Severity] = {}
        worst_of_pair: dict[tuple[int, ...], Severity] = {}
        for life in lives:
            severity = life.severity_at(asked_s)
            if severity is None:
                continue
            worst_of_pair[life.track_ids] = worse(worst_of_pair.get(life.track_ids, "unknown"), severity)
            for track_id in life.track_ids:
                worst[track_id] = worse(worst.get(track_id, "unknown"), severity)
        places = {row["track_id"]: (row["x_m"], row["y_m"]) for row in tracks if row["valid"]}
        share = frame["watched_share"]
        return FrameAt(
            time_s=time_s,
            has_map=isinstance(ground, GroundMap),
            reason=ground.reason if isinstance(ground, NoGroundMap) else "",
            watched_share=None if math.isnan(share) else share,
            is_moved=is_moved,
            tracks=[_track(row, ground, worst.get(row["track_id"])) for row in tracks],
            pairs=[self._pair(row, places, ground, worst_of_pair) for row in _worth_showing(pairs, worst_of_pair)],
        )

    def _map(self, frame: dict[str, Any]) -> AnyGround:
        if frame["map"] and not isinstance(frame["map_covariance"], np.ndarray):
            return NoGroundMap("an older run, which did not keep its maps")
        try:
            return map_of(frame, self.size_px)
        except (TypeError, ValueError) as error:
            raise DataError(
                expected="a ground map in each row of the frames", found=f"{error}", fix="repeat `standoff run`"
            ) from error

    def _pair(
        self, row: dict[str, Any], places: dict[int, tuple[float, float]], ground: AnyGround,
        worst: dict[tuple[int, ...], Severity],
    ) -> PairAt:  # fmt: skip
        key = row["track_a"], row["track_b"]
        ends_px = None
        if isinstance(ground, GroundMap) and all(one in places for one in key):
            points_px, seen = ground.to_image(np.array([places[one] for one in key]))
            ends_px = (_pixel(points_px[0]), _pixel(points_px[1])) if seen.all() else None
        text = self.unit.distance(row["distance_m"], row["sigma_m"], filtered=bool(row["filtered"]))
        return PairAt(track_a=key[0], track_b=key[1], ends_px=ends_px, text=text, severity=worst.get(key))

    def _whole(self, name: RunTable, columns: Sequence[str], span_s: tuple[float, float] | None = None) -> Columns:
        """Return columns of a table; NaN in those that an older run has not, no row where it was not kept."""
        if name in self.missing:
            return {column: np.zeros(0) for column in columns}
        has = self._files.columns(name)
        table = self._files.table(name, list(dict.fromkeys(("frame", *filter(has.__contains__, columns)))), span_s)
        unknown = np.full(len(table["frame"]), np.nan)
        return {column: table.get(column, unknown) for column in columns}

    def _rows(self, name: RunTable, columns: Sequence[str], span_s: tuple[float, float]) -> list[dict[str, Any]]:
        table = self._whole(name, columns, span_s)
        cells = (table[column].tolist() for column in columns)
        return [dict(zip(columns, row, strict=True)) for row in zip(*cells, strict=True)]


def _by_frame(rows: Sequence[dict[str, Any]]) -> dict[int, list[dict[str, Any]]]:
    found: dict[int, list[dict[str, Any]]] = {}
    for row in rows:
        found.setdefault(row["frame"], []).append(row)
    return found


def _is_moved(before: Sequence[dict[str, Any]], now: Sequence[dict[str, Any]]) -> bool:
    """Return whether places are counted from elsewhere now: then nobody's velocity is known any more."""
    known = {row["track_id"] for row in before if not math.isnan(row["vx_mps"])}
    still = [row for row in now if row["track_id"] in known and row["valid"]]
    return bool(still) and all(math.isnan(row["vx_mps"]) for row in still)


def _track(row: dict[str, Any], ground: AnyGround, severity: Severity | None) -> TrackAt:
    at_m = (row["x_m"], row["y_m"]) if row["valid"] else None
    circle: list[Pixel] = []
    if at_m is not None and isinstance(ground, GroundMap):
        points_px, seen = ground.to_image(np.array(at_m) + row["radius_m"] * _CIRCLE)
        circle = [_pixel(point) for point in points_px[seen]]
    return TrackAt(
        track_id=row["track_id"],
        kind=row["class"],
        box_px=tuple(round(row[f"{edge}_px"], 1) for edge in ("x1", "y1", "x2", "y2")),
        at_m=at_m,
        radius_m=row["radius_m"],
        circle_px=circle,
        is_seen=bool(row["observed"]),
        severity=severity,
    )


def _worth_showing(pairs: Sequence[dict[str, Any]], worst: dict[tuple[int, ...], Severity]) -> Iterator[dict[str, Any]]:
    """Yield those of a hazard, and of the others the nearest."""
    in_hazard = [row for row in pairs if (row["track_a"], row["track_b"]) in worst]
    yield from in_hazard
    others = [row for row in pairs if row["distance_m"] <= _NEAR_M and (row["track_a"], row["track_b"]) not in worst]
    yield from sorted(others, key=lambda row: row["distance_m"])[: max(0, _MOST_PAIRS - len(in_hazard))]


def _least(edges_s: FloatArray, times_s: FloatArray, values: FloatArray) -> FloatArray:
    """Return the least known value from each edge up to the next; NaN where there is none."""
    least = np.full(len(edges_s), np.nan)
    if len(edges_s) and len(times_s):
        span = np.searchsorted(edges_s, times_s, side="right") - 1
        known = np.isfinite(values) & (span >= 0)
        np.fmin.at(least, span[known], values[known])
    return least


def _known(values: FloatArray) -> list[float | None]:
    return [None if math.isnan(value) else value for value in np.round(values, 4).tolist()]


def _pixel(point: FloatArray) -> Pixel:
    return round(float(point[0]), 1), round(float(point[1]), 1)
