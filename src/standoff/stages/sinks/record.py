"""`run.json`: what was run, with what, how it ended and how long each stage took."""

from __future__ import annotations

import platform
import time
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np

from standoff import __version__
from standoff.core.errors import OutputError
from standoff.core.types import FrameResult, GroundMap, Hazard, NoGroundMap, Outcome, Severity
from standoff.files.json_text import json_text, plain, write_json
from standoff.stages.sinks.durations import Durations
from standoff.stages.sinks.scene import worse
from standoff.stages.sinks.watched_shares import WatchedShares

_LIBRARIES = ("numpy", "scipy", "numba", "opencv-python-headless", "onnxruntime", "av", "pyarrow")


_COUNTED = (
    "frames",
    "detected_frames",
    "frames_with_map",
    "detections",
    "sure_detections",
    "unfollowed_detections",
    "positions",
    "valid_positions",
    "distances",
    "measured_distances",
    "filtered_distances",
    "tracks",
    "pairs",
)


class RecordSink:
    """Write the record at the start, with status "running", and again at the end.

    A record that still says "running" after its process has gone belongs to a killed run.

    Args:
        path: The file, usually `run.json`.
        descriptions: What only the caller knows (resolved configuration, source, model, ground), kept as
            given; what JSON has no word for becomes text, and a number that is not finite null.
        at_close: Gives those anew that are only known after the last frame; None: nothing is.

    Attributes:
        record: What the file says, or should say where it could not be written.

    Raises:
        OutputError: The file cannot be written.
    """

    def __init__(
        self,
        path: Path | str,
        descriptions: Mapping[str, Any],
        at_close: Callable[[], Mapping[str, Any]] | None = None,
    ) -> None:
        self._at_close = at_close
        self._path = Path(path)
        self._head = {"started_at": datetime.now(UTC), "versions": library_versions(), **descriptions}
        self._started = time.monotonic()
        self._counts: Counter[str] = Counter(dict.fromkeys(_COUNTED, 0))
        self._no_map: Counter[str] = Counter()
        self._map_methods: Counter[str] = Counter()
        self._invalid: Counter[str] = Counter()
        self._watched = WatchedShares()
        self._hazard_severity: dict[str, Severity] = {}
        self._hazard_zone: dict[str, str] = {}
        self._live_tracks: set[int] = set()
        self._live_pairs: set[tuple[int, int]] = set()
        self._stages: defaultdict[str, Durations] = defaultdict(Durations)
        self.record: dict[str, Any] = {"status": "running", "message": "", **self._head}
        write_json(self._path, self.record)

    def write(self, result: FrameResult) -> None:
        """Count this frame."""
        self._count_rows(result)
        self._count_new_ids(result)
        if isinstance(result.ground, NoGroundMap):
            self._no_map[result.ground.reason] += 1
        else:
            self._map_methods[result.ground.method] += 1
        self._invalid.update(result.positions.reason[~result.positions.valid].tolist())
        self._watched.add(result.watched)
        self._count_hazards(result.hazards)
        for stage, duration_ms in result.stage_ms.items():
            self._stages[stage].add(duration_ms)

    def _count_hazards(self, events: Iterable[Hazard]) -> None:
        for event in events:
            so_far = self._hazard_severity.get(event.hazard_id, "unknown")
            self._hazard_severity[event.hazard_id] = worse(event.severity, so_far)
            if event.zone:
                self._hazard_zone[event.hazard_id] = event.zone

    def _zone_counts(self) -> dict[str, Counter[str]]:
        """Return the number of hazards of each zone that had any, by severity."""
        counts: dict[str, Counter[str]] = {}
        for hazard_id, zone in sorted(self._hazard_zone.items(), key=lambda one: one[1]):
            counts.setdefault(zone, Counter())[self._hazard_severity[hazard_id]] += 1
        return counts

    def _count_rows(self, result: FrameResult) -> None:
        positions, pairs = result.positions, result.proximities
        self._counts.update(
            frames=1,
            detected_frames=int(result.detected),
            frames_with_map=int(isinstance(result.ground, GroundMap)),
            detections=len(result.detections),
            sure_detections=len(result.unfollowed),
            unfollowed_detections=int(result.unfollowed.sum()),
            positions=len(positions),
            valid_positions=int(positions.valid.sum()),
            distances=len(pairs),
            measured_distances=int(np.isfinite(pairs.distance_m).sum()),
            filtered_distances=int(pairs.filtered.sum()),
        )

    def _count_new_ids(self, result: FrameResult) -> None:
        """Count ids that the last frame did not have: a track is listed from its birth to its end."""
        pairs = result.proximities
        tracks = set(result.tracks.track_id.tolist())
        live_pairs = set(zip(pairs.track_a.tolist(), pairs.track_b.tolist(), strict=True))
        self._counts.update(tracks=len(tracks - self._live_tracks), pairs=len(live_pairs - self._live_pairs))
        self._live_tracks, self._live_pairs = tracks, live_pairs

    def close(self, outcome: Outcome) -> None:
        """Write the final record; where there is no room for it, at least how the run ended.

        Raises:
            OutputError: The whole record could not be written.
        """
        self._count_hazards(outcome.hazards)
        status, message = outcome.status, outcome.message
        if outcome.sink_errors and status == "complete":
            # Whoever looks for "complete" relies on every file of the folder.
            status, message = "failed", f"not whole: {', '.join(outcome.sink_errors)} (see sink_errors)"
        wall_s = time.monotonic() - self._started
        self.record = plain(
            {
                "status": status,
                "message": message,
                **self._head,
                **(self._at_close() if self._at_close is not None else {}),
                "finished_at": datetime.now(UTC),
                "wall_s": round(wall_s, 3),
                "frames_per_s": round(self._counts["frames"] / wall_s, 2) if wall_s > 0 else None,
                "counts": {
                    **self._counts,
                    "hazards": Counter(self._hazard_severity.values()),
                    **({"zones": zones} if (zones := self._zone_counts()) else {}),
                    "map_methods": self._map_methods,
                    "no_ground_map": self._no_map,
                    "invalid_positions": self._invalid,
                },
                "watched_ground": self._watched.summary(),
                "stages": {stage: durations.summary() for stage, durations in self._stages.items()},
                "sink_errors": dict(outcome.sink_errors),
            }
        )
        try:
            write_json(self._path, self.record)
        except OutputError as error:
            message = f"{message or 'the run came to its end'}; this record is not whole: {error.found}"
            lost = {**outcome.sink_errors, "record": str(error)}
            self.record |= {"status": "failed", "message": message, "sink_errors": lost}
            _write_over(self._path, {name: self.record[name] for name in ("status", "message", "sink_errors")})
            raise


def _write_over(path: Path, short: Mapping[str, Any]) -> None:
    """Put something short in the place of a longer text, which takes no room that is not there."""
    with suppress(OSError), path.open("r+", encoding="utf-8") as file:
        file.write(json_text(short))
        file.truncate()


def library_versions() -> dict[str, str]:
    """Return the versions of standoff, Python, the libraries that results depend on, and the platform."""
    found = {"standoff": __version__, "python": platform.python_version(), "platform": platform.platform()}
    for name in _LIBRARIES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "not installed"
    return found
