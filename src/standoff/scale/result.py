"""What became of one film, read from the folder of its run."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from statistics import fmean
from typing import Any, Final, Literal

import pyarrow.parquet as pq

from standoff.clips.run_folder import RunFolder
from standoff.core.hazard_life import HazardLife
from standoff.core.outputs import OUTPUTS, RECORD_FILE
from standoff.files.json_text import read_json

_WORST: Final = 3
"""So many moments of a film are in the overview."""


@dataclass(frozen=True, slots=True)
class Moment:
    """When a hazard was at its worst: what it was, when, and how near somebody was.

    Attributes:
        time_s: Of the film.
        severity: "danger" or "warning".
        between: Whom it is about.
        gap_m: Distance less both action radii, or to a zone's edge; NaN where it was not measured.
        place_m: (x, y) in the site frame, in the middle of those whom it is about; None where no track says it.
    """

    time_s: float
    severity: str
    between: str
    gap_m: float
    place_m: tuple[float, float] | None = None

    def rank(self) -> tuple[bool, float]:
        """Return what to sort by: danger first, then by how near it was."""
        return self.severity != "danger", math.inf if math.isnan(self.gap_m) else self.gap_m


@dataclass(frozen=True, slots=True)
class Findings:
    """What a complete run found.

    Attributes:
        watched_s: Seconds of the film that were looked at; NaN where the film does not say how long it is.
        mapped_share: Of the frames that have a ground map; NaN where there is no frame.
        ground_share: Of the ground in the pictures that counted as watched; NaN where nobody judged.
        worker_hours: Hours of workers in sight.
        alarms: Hazards that somebody would have been told of.
        hazards: How many there were, by the gravest that each was.
        worst: The gravest and nearest moments.
    """

    watched_s: float
    mapped_share: float
    ground_share: float
    worker_hours: float
    alarms: int
    hazards: Mapping[str, int]
    worst: tuple[Moment, ...]


@dataclass(frozen=True, slots=True)
class FilmResult:
    """What became of one film.

    Attributes:
        film: The file.
        folder: Of its run.
        status: "complete", or "failed": then nothing is known of the film.
        message: Why it failed, in one line; empty where all went well.
        is_new: False: it was finished before, with the same settings, files and version.
        found: None where it failed.
    """

    film: Path
    folder: Path
    status: Literal["complete", "failed"]
    message: str = ""
    is_new: bool = True
    found: Findings | None = None

    def to_dict(self) -> dict[str, Any]:
        """Return plain values; NaN stays NaN."""
        return {**asdict(self), "film": str(self.film), "folder": str(self.folder)}


def read_result(film: Path, folder: Path, *, is_new: bool = True) -> FilmResult:
    """Read what became of a film from the folder of its run.

    Raises:
        DataError: Its record or its hazards are missing or broken.
    """
    record = read_json(folder / RECORD_FILE, "a run's record")
    if record["status"] != "complete":
        return FilmResult(film, folder, "failed", record.get("message") or f"its run says {record['status']}", is_new)
    return FilmResult(film, folder, "complete", "", is_new, _findings(record, folder))


def _findings(record: Mapping[str, Any], folder: Path) -> Findings:
    counts, alarms = record["counts"], record.get("alarms") or {}
    frames = counts["frames"]
    share = (record.get("watched_ground") or {}).get("share")
    return Findings(
        watched_s=_watched_s(record["source"]),
        mapped_share=counts["frames_with_map"] / frames if frames else math.nan,
        ground_share=math.nan if share is None else float(share),
        worker_hours=float(alarms.get("worker_hours") or 0.0),
        alarms=int(alarms.get("alarms") or 0),
        hazards=dict(counts["hazards"]),
        worst=tuple(_worst(folder)),
    )


def _watched_s(source: Mapping[str, Any]) -> float:
    ends = [end_s for name in ("duration_s", "stop_s") if (end_s := source.get(name)) is not None]
    return max(min(ends) - (source.get("start_s") or 0.0), 0.0) if source.get("duration_s") is not None else math.nan


def _worst(folder: Path) -> Iterator[Moment]:
    """Yield the gravest, then nearest moments of the hazards of a run."""
    lives = RunFolder(folder).hazard_lives() if (folder / OUTPUTS["hazards"]).is_file() else []
    told = ((_moment(life), life) for life in lives if life.severity != "unknown")
    for moment, life in sorted(told, key=lambda one: one[0].rank())[:_WORST]:
        yield replace(moment, place_m=_middle_m(folder / OUTPUTS["tracks"], life.worst_frame, life.track_ids))


def _moment(life: HazardLife) -> Moment:
    between = " and ".join(filter(None, (*life.names, life.zone))).replace("_", " ")
    return Moment(life.worst_s, life.severity, between, life.worst_gap_m)


def _middle_m(tracks: Path, frame: int | None, track_ids: Sequence[int]) -> tuple[float, float] | None:
    """Return where some tracks are in a frame, on the mean; None where nothing says so of each of them."""
    if frame is None or not tracks.is_file() or not track_ids:
        return None
    wanted = [("frame", "==", frame), ("track_id", "in", list(track_ids))]
    places = pq.read_table(tracks, columns=["x_m", "y_m"], filters=wanted).to_pydict()
    known = [(x, y) for x, y in zip(places["x_m"], places["y_m"], strict=True) if x is not None and y is not None]
    if len(known) < len(track_ids):
        return None
    return fmean(x for x, _ in known), fmean(y for _, y in known)
