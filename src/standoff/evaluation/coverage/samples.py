"""Everything that a run said of one clip's visible pairs and entities, beside what is true: from tables alone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from standoff.core.classes import CLASS_BY_NAME, CLASSES, Role, class_ids
from standoff.core.errors import DataError
from standoff.core.homography import FloatArray
from standoff.core.types import IntArray, TextArray
from standoff.evaluation.coverage.site_frame import rests_on_reference, shared_turning
from standoff.evaluation.matching import NOTHING, match_boxes
from standoff.evaluation.pair_rows import PairRows, distances_of
from standoff.evaluation.paper.clip_tables import PAIRS, read_table
from standoff.evaluation.paper.turning import Turning
from standoff.evaluation.positions_input import PAIR_COLUMNS, TRACK_COLUMNS, Columns, chosen_rows, read_run_table
from standoff.files.json_text import read_json
from standoff.stages.frames.fingerprint import fingerprint
from standoff.stages.ground import load_camera

WHOLE, HIDDEN, CUT_OFF = range(3)
SIGHTS = ("whole", "hidden", "cut off")
"""How a pair shows, by the worse of the two: whole, with something in front, or beyond the picture's edge."""

_BOX = ("x1_px", "y1_px", "x2_px", "y2_px")
_FULL_BOX = tuple(f"full_{edge}" for edge in _BOX)
_TRUTH = ("frame", "time_s", "entity_id", "class_id", "x_m", "y_m", "visible_share", *_BOX, *_FULL_BOX)
_TRACKS = (*TRACK_COLUMNS, "sigma_x_m", "sigma_y_m", "cov_xy_m2")
_FRAMES = ("frame", "time_s", "map_method")

_WHOLE_SHARE = 0.9
"""A tenth of a silhouette is what a pole in front of it takes, and the error of truth that is told without pictures."""
_BEYOND_EDGE_PX = 1.0
_SAME_TIME_S = 0.005
"""Presentation times are whole ticks of a clock; frames are at least three times as far apart."""


@dataclass(frozen=True, slots=True, eq=False)
class PairSamples:
    """A person and a machine, both visible in one frame, N times.

    Attributes:
        kind: (N,) "worker-excavator", by the true classes.
        true_m: (N,) distance, centre to centre.
        measured_m: (N,) as the run has it; NaN where it has none: not measured, or one of the two not found.
        sigma_m: (N,) standard error that the run states; NaN where it states none.
        sight: (N,) of `SIGHTS`.
    """

    kind: TextArray
    true_m: FloatArray
    measured_m: FloatArray
    sigma_m: FloatArray
    sight: IntArray


@dataclass(frozen=True, slots=True, eq=False)
class PositionSamples:
    """One entity that is visible in one frame, N times.

    Attributes:
        class_name: (N,) its true class.
        off_m: (N, 2) its position less the true one, site frame; NaN where it has none.
        covariance_m2: (N, 2, 2) that the run states; NaN with it.
    """

    class_name: TextArray
    off_m: FloatArray
    covariance_m2: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class ClipSamples:
    """One run of one clip.

    Attributes:
        run: Folder.
        clip: Folder.
        frames: That the run read.
        pairs: Visible pairs in them.
        positions: Visible entities in them; None where the run counts its places from somewhere else than the truth.
    """

    run: Path
    clip: Path
    frames: int
    pairs: PairSamples
    positions: PositionSamples | None


def read_samples(run: Path, clip: Path) -> ClipSamples:
    """Compare a run's tables with a clip's truth, in every frame that the run read.

    Args:
        run: Folder with `tracks.parquet`, `proximity.parquet` and `frames.parquet`.
        clip: Folder that `standoff simulate` wrote, with or without a film.

    Raises:
        DataError: A file is missing or not what it should be, or the run is not one of this clip.
    """
    frames = read_run_table(run / "frames.parquet", _FRAMES)
    truth = _read_truth(clip)
    record = _read_record(run)
    _check_same_film(frames, truth, record, run, clip)
    truth, tracks = _shown(truth, frames), _read_tracks(run)
    track_row, *ends = _match(truth, tracks)
    turning = shared_turning(record.get("settings") or {}, clip)
    return ClipSamples(
        run=run,
        clip=clip,
        frames=len(frames["frame"]),
        pairs=_pairs(truth, tracks, track_row, ends, run, clip),
        positions=None if turning is None else _positions(truth, tracks, track_row, frames, turning),
    )


def _read_record(run: Path) -> Mapping[str, Any]:
    """Return what the run says of itself; empty where tables alone were kept."""
    path = run / "run.json"
    record = read_json(path, "a run's record") if path.is_file() else {}
    parts = [record.get(name) or {} for name in ("source", "settings")] if isinstance(record, dict) else [None]
    if not all(isinstance(part, dict) for part in parts):
        raise DataError(expected="a run's record", found=f"something else in {path}", fix="repeat `standoff run`")
    return dict(record)


def _read_truth(clip: Path) -> Columns:
    truth = read_table(clip / "truth.parquet", _TRUTH)
    class_id = truth["class_id"]
    if not len(class_id) or not ((class_id >= 0) & (class_id < len(CLASSES))).all():
        fix = "render the clip again with `standoff simulate`"
        raise DataError(expected="entities of known classes", found=f"others in {clip / 'truth.parquet'}", fix=fix)
    camera = load_camera(clip / "camera.yaml")
    truth = {**truth, "sight": _sights(truth, np.array([camera.width_px, camera.height_px]))}
    return chosen_rows(truth, np.argsort(truth["frame"], kind="stable"))


def _sights(truth: Columns, size_px: IntArray) -> IntArray:
    full_px = np.column_stack([truth[name] for name in _FULL_BOX])
    # The first pixel's centre is (0, 0): pictures begin and end half a pixel beyond it.
    beyond_px = np.concatenate([-0.5 - full_px[:, :2], full_px[:, 2:] - (size_px - 0.5)], axis=1)
    # A part behind the camera has no box, and no smaller overhang than one pixel.
    inside = (beyond_px <= _BEYOND_EDGE_PX).all(axis=1)
    return np.where(inside, np.where(truth["visible_share"] < _WHOLE_SHARE, HIDDEN, WHOLE), CUT_OFF)


def _check_same_film(frames: Columns, truth: Columns, record: Mapping[str, Any], run: Path, clip: Path) -> None:
    fix = "give each run with the clip that it is of"
    place = np.minimum(np.searchsorted(truth["frame"], frames["frame"]), len(truth["frame"]) - 1)
    known = truth["frame"][place] == frames["frame"]
    if not known.all() or not (np.abs(truth["time_s"][place] - frames["time_s"]) <= _SAME_TIME_S).all():
        raise DataError(
            expected=f"frames of {clip}", found=f"frames in {run} that it does not have at those times", fix=fix
        )
    video, recorded = clip / "video.mp4", (record.get("source") or {}).get("fingerprint")
    if recorded is not None and video.is_file() and recorded != fingerprint([video]):
        raise DataError(expected=f"a run of {video}", found=f"{run}, which is of a film with other content", fix=fix)


def _shown(truth: Columns, frames: Columns) -> Columns:
    """Return the truth of entities that can be seen, in the frames that the run read, frame by frame."""
    rows = np.isin(truth["frame"], frames["frame"]) & ~np.isin(truth["class_id"], class_ids(Role.REFERENCE))
    rows &= np.isfinite(np.column_stack([truth[name] for name in _BOX])).all(axis=1)
    return chosen_rows(truth, rows)


def _read_tracks(run: Path) -> Columns:
    path = run / "tracks.parquet"
    tracks = read_run_table(path, _TRACKS)
    names, which = np.unique(tracks["class"].astype(np.str_), return_inverse=True)
    unknown = sorted(set(names.tolist()) - CLASS_BY_NAME.keys())
    if unknown:
        fix = "repeat the run with this version"
        raise DataError(expected="classes of standoff", found=f"{', '.join(unknown)} in {path}", fix=fix)
    class_id = np.array([CLASS_BY_NAME[name].id for name in names.tolist()], dtype=np.int64)[which]
    tracks = {**tracks, "class_id": class_id}
    return chosen_rows(tracks, np.argsort(tracks["frame"], kind="stable"))


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


def _pairs(
    truth: Columns, tracks: Columns, track_row: IntArray, ends: Sequence[IntArray], run: Path, clip: Path
) -> PairSamples:
    table = read_table(clip / "pairs.parquet", PAIRS)
    rows = PairRows(table["frame"], table["entity_a"], table["entity_b"])
    listed = rows.find(truth["frame"][ends[0]], *(truth["entity_id"][end] for end in ends))
    # Vehicles parked in the street keep no distance to anybody.
    ends, listed = [end[listed != NOTHING] for end in ends], listed[listed != NOTHING]
    track_id = np.append(tracks["track_id"], NOTHING)[track_row]
    measured_m, sigma_m, _ = distances_of(
        read_run_table(run / "proximity.parquet", PAIR_COLUMNS),
        truth["frame"][ends[0]],
        *(track_id[end] for end in ends),
    )
    names = _names(truth["class_id"])
    return PairSamples(
        kind=names[ends[0]] + "-" + names[ends[1]],
        true_m=table["centre_m"][listed],
        measured_m=measured_m,
        sigma_m=sigma_m,
        sight=np.maximum(*(truth["sight"][end] for end in ends)),
    )


def _positions(
    truth: Columns, tracks: Columns, track_row: IntArray, frames: Columns, turning: Turning
) -> PositionSamples:
    found = track_row != NOTHING
    rows = track_row[found]
    xy_m, covariance_m2 = np.full((len(found), 2), np.nan), np.full((len(found), 2, 2), np.nan)
    xy_m[found] = np.column_stack([tracks["x_m"], tracks["y_m"]])[rows]
    sigma_x_m, sigma_y_m, shared_m2 = (tracks[name][rows] for name in ("sigma_x_m", "sigma_y_m", "cov_xy_m2"))
    covariance_m2[found] = np.stack([sigma_x_m**2, shared_m2, shared_m2, sigma_y_m**2], axis=1).reshape(-1, 2, 2)
    true_m = np.column_stack([truth["x_m"], truth["y_m"]])
    mapped = np.array([rests_on_reference(method) for method in frames["map_method"].tolist()], dtype=np.bool_)
    xy_m[~np.isin(truth["frame"], frames["frame"][mapped])] = np.nan
    placed = np.flatnonzero(np.isfinite(xy_m).all(axis=1))
    # A square looks the same four ways: the turn that brings a frame's places nearest to the truth counts.
    for here in np.split(placed, np.flatnonzero(np.diff(truth["frame"][placed])) + 1) if len(placed) else ():
        turn = turning.nearest(xy_m[here], true_m[here])
        xy_m[here] = turning.to_site(xy_m[here], turn)
        covariance_m2[here] = turning.covariance_to_site(covariance_m2[here], turn)
    return PositionSamples(_names(truth["class_id"]), xy_m - true_m, covariance_m2)


def _names(class_id: IntArray) -> TextArray:
    names: TextArray = np.array([site_class.name for site_class in CLASSES], dtype=object)[class_id]
    return names
