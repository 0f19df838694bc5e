"""A run's tables beside the truth of the clip that it is of: what shows which entity, in every frame."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from standoff.clips import (
    CAMERA_FILE,
    PAIRS_FILE,
    RENDER_AGAIN,
    TRUTH_FILE,
    VIDEO_FILE,
    Columns,
    RunFolder,
    chosen_rows,
    read_clip_table,
)
from standoff.core.classes import CLASSES, Role, class_ids
from standoff.core.errors import DataError
from standoff.core.homography import BoolArray, FloatArray
from standoff.core.types import IntArray
from standoff.evaluation.matching import NOTHING, match_boxes
from standoff.evaluation.pair_rows import PAIR_COLUMNS, PairRows, distances_of
from standoff.evaluation.positions_input import TRACK_COLUMNS
from standoff.files.fingerprint import fingerprint
from standoff.stages.ground import load_camera

WHOLE, HIDDEN, CUT_OFF = range(3)
SIGHTS = ("whole", "hidden", "cut off")
"""How a pair shows, by the worse of the two: whole, with something in front, or beyond the picture's edge."""

_BOX = ("x1_px", "y1_px", "x2_px", "y2_px")
_FULL_BOX = tuple(f"full_{edge}" for edge in _BOX)
_TRUTH = ("frame", "time_s", "entity_id", "class_id", "x_m", "y_m", "visible_share", *_BOX, *_FULL_BOX)
_TRACKS = (*TRACK_COLUMNS, "sigma_x_m", "sigma_y_m", "cov_xy_m2")
_FRAMES = ("frame", "time_s", "map_method")
_PAIRS = ("frame", "entity_a", "entity_b", "centre_m")

_WHOLE_SHARE = 0.9
"""A tenth of a silhouette is what a pole in front of it takes, and the error of truth that is told without pictures."""
_BEYOND_EDGE_PX = 1.0
_SAME_TIME_S = 0.005
"""Presentation times are whole ticks of a clock; frames are at least three times as far apart."""
_ITS_OWN_CLIP = "give each run with the clip that it is of"


_Samples = TypeVar("_Samples")


@dataclass(frozen=True, slots=True, eq=False)
class BesideTruth:
    """One run of one clip.

    Attributes:
        record: What the run says of itself; empty where tables alone were kept.
        size_px: (width, height) of the pictures.
        frames: Columns of the run's frames.
        truth: Columns of the entities (T) that can be seen in them, frame by frame; `sight` is of `SIGHTS`.
        tracks: Columns of the run's tracks, frame by frame.
        track_row: (T,) row of the track that shows each entity, NOTHING where none does.
        ends: (N,) rows of truth of the person and of the machine of every visible pair.
        true_m: (N,) their true distance; NaN where there is none: vehicles parked in the street keep no distance.
        measured_m: (N,) as the run has it; NaN where it has none: not measured, or one of the two not found.
        sigma_m: (N,) standard error that the run states for it; NaN where it states none.
    """

    record: Mapping[str, Any]
    size_px: tuple[int, int]
    frames: Columns
    truth: Columns
    tracks: Columns
    track_row: IntArray
    ends: tuple[IntArray, IntArray]
    true_m: FloatArray
    measured_m: FloatArray
    sigma_m: FloatArray

    @property
    def track_id(self) -> IntArray:
        """(T,) id of the track that shows each entity, NOTHING where none does."""
        return _ids(self.tracks, self.track_row)

    @property
    def is_person(self) -> BoolArray:
        """(T,)."""
        return np.isin(self.truth["class_id"], class_ids(Role.PERSON))


def read_beside_truth(
    run: Path, clip: Path, frame_columns: Sequence[str] = (), truth_columns: Sequence[str] = ()
) -> BesideTruth:
    """Compare a run's tables with a clip's truth, in every frame that the run read.

    Args:
        run: Folder with `tracks.parquet`, `proximity.parquet` and `frames.parquet`.
        clip: Folder that `standoff simulate` wrote, with or without a film.
        frame_columns: More of the run's frames than are needed here.
        truth_columns: More of the truth.

    Raises:
        DataError: A file is missing or not what it should be, or the run is not one of this clip.
    """
    told = RunFolder(run)
    frames = told.table("frames", (*_FRAMES, *frame_columns))
    camera = load_camera(clip / CAMERA_FILE)
    size_px = camera.width_px, camera.height_px
    truth = _read_truth(clip, size_px, truth_columns)
    record = told.record()
    _check_same_frames(frames, truth, run, clip)
    check_same_film(record, run, clip)
    truth, tracks = _shown(truth, frames), told.tracks(_TRACKS)
    track_row, *ends = _match(truth, tracks)
    track_id = _ids(tracks, track_row)
    frame = truth["frame"][ends[0]]
    measured_m, sigma_m, _ = distances_of(
        told.table("proximity", PAIR_COLUMNS), frame, *(track_id[end] for end in ends)
    )
    return BesideTruth(
        record=record,
        size_px=size_px,
        frames=frames,
        truth=truth,
        tracks=tracks,
        track_row=track_row,
        ends=(ends[0], ends[1]),
        true_m=_true_distances_m(clip, frame, *(truth["entity_id"][end] for end in ends)),
        measured_m=measured_m,
        sigma_m=sigma_m,
    )


def read_each(
    runs: Sequence[tuple[Path, Path]], read: Callable[[Path, Path], _Samples], on_run: Callable[[], None] | None
) -> list[_Samples]:
    """Read what is scored of several runs.

    Args:
        runs: Folder of each run and of its clip.
        read: Reads one.
        on_run: Called after each.
    """
    samples = []
    for run, clip in runs:
        samples.append(read(run, clip))
        if on_run is not None:
            on_run()
    return samples


def _read_truth(clip: Path, size_px: tuple[int, int], more: Sequence[str]) -> Columns:
    truth = read_clip_table(clip, TRUTH_FILE, (*_TRUTH, *more))
    class_id = truth["class_id"]
    if not len(class_id) or not ((class_id >= 0) & (class_id < len(CLASSES))).all():
        raise DataError(expected="entities of known classes", found=f"others in {clip / TRUTH_FILE}", fix=RENDER_AGAIN)
    truth = {**truth, "sight": _sights(truth, np.array(size_px))}
    return chosen_rows(truth, np.argsort(truth["frame"], kind="stable"))


def _sights(truth: Columns, size_px: IntArray) -> IntArray:
    full_px = np.column_stack([truth[name] for name in _FULL_BOX])
    # The first pixel's centre is (0, 0): pictures begin and end half a pixel beyond it.
    beyond_px = np.concatenate([-0.5 - full_px[:, :2], full_px[:, 2:] - (size_px - 0.5)], axis=1)
    # A part behind the camera has no box, and no smaller overhang than one pixel.
    inside = (beyond_px <= _BEYOND_EDGE_PX).all(axis=1)
    return np.where(inside, np.where(truth["visible_share"] < _WHOLE_SHARE, HIDDEN, WHOLE), CUT_OFF)


def check_same_film(record: Mapping[str, Any], run: Path, clip: Path) -> None:
    """Raise DataError where a run says that it is of a film with other content than a clip's."""
    video, recorded = clip / VIDEO_FILE, (record.get("source") or {}).get("fingerprint")
    if recorded is not None and video.is_file() and recorded != fingerprint([video]):
        found = f"{run}, which is of a film with other content"
        raise DataError(expected=f"a run of {video}", found=found, fix=_ITS_OWN_CLIP)


def _check_same_frames(frames: Columns, truth: Columns, run: Path, clip: Path) -> None:
    place = np.minimum(np.searchsorted(truth["frame"], frames["frame"]), len(truth["frame"]) - 1)
    known = truth["frame"][place] == frames["frame"]
    if not known.all() or not (np.abs(truth["time_s"][place] - frames["time_s"]) <= _SAME_TIME_S).all():
        found = f"frames in {run} that it does not have at those times"
        raise DataError(expected=f"frames of {clip}", found=found, fix=_ITS_OWN_CLIP)


def _shown(truth: Columns, frames: Columns) -> Columns:
    """Return the truth of entities that can be seen, in the frames that the run read, frame by frame."""
    rows = np.isin(truth["frame"], frames["frame"]) & ~np.isin(truth["class_id"], class_ids(Role.REFERENCE))
    rows &= np.isfinite(np.column_stack([truth[name] for name in _BOX])).all(axis=1)
    return chosen_rows(truth, rows)


def _ids(tracks: Columns, track_row: IntArray) -> IntArray:
    ids: IntArray = np.append(tracks["track_id"], NOTHING)[track_row]
    return ids


def _true_distances_m(clip: Path, frame: IntArray, first: IntArray, second: IntArray) -> FloatArray:
    """Return (N,) the true distance of each two entities; NaN where the clip has none."""
    table = read_clip_table(clip, PAIRS_FILE, _PAIRS)
    row = PairRows(table["frame"], table["entity_a"], table["entity_b"]).find(frame, first, second)
    true_m = np.full(len(row), np.nan)
    true_m[row != NOTHING] = table["centre_m"][row[row != NOTHING]]
    return true_m


def _match(truth: Columns, tracks: Columns) -> tuple[IntArray, IntArray, IntArray]:
    """Return (T,) the row of each truth's track, and (N,) rows of truth of the two ends of every visible pair."""
    true_px, seen_px = (np.column_stack([rows[name] for name in _BOX]) for rows in (truth, tracks))
    is_person = np.isin(truth["class_id"], class_ids(Role.PERSON))
    track_row = np.full(len(true_px), NOTHING)
    people, machines = [np.zeros(0, np.int64)], [np.zeros(0, np.int64)]
    for frame in np.unique(truth["frame"]):
        here, seen = (slice(*np.searchsorted(rows["frame"], [frame, frame + 1])) for rows in (truth, tracks))
        found = match_boxes(true_px[here], truth["class_id"][here], seen_px[seen], tracks["class_id"][seen])
        track_row[here] = np.where(found == NOTHING, NOTHING, found + seen.start)
        of_people, of_machines = (here.start + np.flatnonzero(kind) for kind in (is_person[here], ~is_person[here]))
        people.append(np.repeat(of_people, len(of_machines)))
        machines.append(np.tile(of_machines, len(of_people)))
    return track_row, np.concatenate(people), np.concatenate(machines)
