"""Read a clip with exact truth: the folder that `standoff simulate` writes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from standoff.clips.clip_folder import (
    CAMERA_FILE,
    CLIP_FORMAT,
    CLIP_FRAMES_FILE,
    PAIRS_FILE,
    REFERENCE_FILE,
    RENDER_AGAIN,
    SCENE_FILE,
    TRUTH_FILE,
    VIDEO_FILE,
    read_clip_table,
)
from standoff.clips.columns import Columns
from standoff.core.classes import CLASSES, Role
from standoff.core.errors import DataError
from standoff.core.homography import BoolArray, FloatArray
from standoff.core.types import IntArray
from standoff.files.json_text import read_json

_TRUTH = ("frame", "entity_id", "class_id", "x_m", "y_m", "x1_px", "y1_px", "x2_px", "y2_px", "foot_x_px", "foot_y_px")
_PAIRS = ("frame", "entity_a", "entity_b", "centre_m")
_REFERENCE_PX = ("reference_top_x_px", "reference_top_y_px")
_CAMERA = ("camera_x_m", "camera_y_m", "camera_z_m", "site_to_camera")
_FRAMES = (
    "frame",
    "reference_covered",
    "reference_visible_share",
    *_REFERENCE_PX,
    "board_x_px",
    "board_y_px",
    *_CAMERA,
)


@dataclass(frozen=True, slots=True, eq=False)
class TrueReference:
    """The reference object as it really is.

    Attributes:
        entity_id: In the truth.
        corners_m: (4, 2) of its top, site frame.
        ground_m: Height of the ground on which it stands, site frame: the plane of a map.
        corners_px: (F, 4, 2) the same corners in each picture; NaN where no lens sees them.
        visible_share: (F,) of its pixels that can be seen.
        covered: (F,) whether something lies on it.
    """

    entity_id: int
    corners_m: FloatArray
    ground_m: float
    corners_px: FloatArray
    visible_share: FloatArray
    covered: BoolArray

    def inside(self, size_px: tuple[int, int]) -> BoolArray:
        """Return (F,) whether all four corners are in the picture; what lies on them does not matter."""
        # A corner that no lens sees is NaN, and NaN is not inside.
        in_picture = (self.corners_px >= -0.5) & (self.corners_px <= np.array(size_px) - 0.5)
        return np.asarray(in_picture.all(axis=(1, 2)), dtype=np.bool_)


@dataclass(frozen=True, slots=True, eq=False)
class TrueBoard:
    """A checkerboard as it really is.

    Attributes:
        side: Inner corners along a side.
        square_m: Side of a square.
        corners_px: (F, side, side, 2) in each picture.
    """

    side: int
    square_m: float
    corners_px: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Clip:
    """A clip with its truth, as arrays by frame (F), entity (E, the reference left out) and pair (P).

    Attributes:
        folder: Where it is.
        preset: What it was rendered from.
        seed: Of the rendering.
        frame_count: F.
        entity_id: (E,) rising.
        class_id: (E,) ids of `CLASSES`.
        box_px: (F, E, 4) visible part; NaN where nothing can be seen.
        xy_m: (F, E, 2) centre of the footprint, site frame.
        foot_px: (F, E, 2) where the picture shows that centre, inside or outside.
        camera_m: (F, 3) place of the camera, site frame.
        site_to_camera: (F, 3, 3) its rotation.
        reference_box_px: (F, 4) visible part of the reference; NaN where nothing can be seen, or without one.
        pairs: (P, 2) rows of E: each person with each machine between which there is a distance, the person first.
        distance_m: (F, P) true distance, centre to centre.
        reference: None without one, or with a checkerboard.
        board: None without one.
    """

    folder: Path
    preset: str
    seed: int
    frame_count: int
    entity_id: IntArray
    class_id: IntArray
    box_px: FloatArray
    xy_m: FloatArray
    foot_px: FloatArray
    camera_m: FloatArray
    site_to_camera: FloatArray
    reference_box_px: FloatArray
    pairs: IntArray
    distance_m: FloatArray
    reference: TrueReference | None
    board: TrueBoard | None

    @property
    def name(self) -> str:
        """The folder's name."""
        return self.folder.resolve().name

    @property
    def video(self) -> Path:
        """The video's file."""
        return self.folder / VIDEO_FILE

    @property
    def camera_file(self) -> Path:
        """The file of the camera's matrix and distortion."""
        return self.folder / CAMERA_FILE

    @property
    def settings_file(self) -> Path:
        """The settings that describe the reference object and the camera."""
        return self.folder / REFERENCE_FILE

    def names(self) -> list[str]:
        """Return (E,) the classes, numbered where there are several of one."""
        of_class = [CLASSES[class_id].name for class_id in self.class_id]
        return [
            name if of_class.count(name) == 1 else f"{name} {1 + of_class[:row].count(name)}"
            for row, name in enumerate(of_class)
        ]


def load_clip(folder: Path | str, *, with_film: bool = True) -> Clip:
    """Read a clip folder.

    Args:
        folder: Holds `video.mp4`, `scene.json`, `camera.yaml`, `reference.yaml` and the three tables of truth.
        with_film: Whether there must be a video; `--truth-only` writes none.

    Raises:
        DataError: A file is missing or not what it should be, or the clip shows nothing that the paper's tests need.
    """
    folder = Path(folder)
    scene = read_scene(folder)
    for name in (*([VIDEO_FILE] if with_film else []), CAMERA_FILE, REFERENCE_FILE):
        if not (folder / name).is_file():
            raise DataError(expected=f"{name} in the clip", found=f"no {folder / name}", fix=RENDER_AGAIN)
    truth, pairs, frames = (
        read_clip_table(folder, name, columns)
        for name, columns in ((TRUTH_FILE, _TRUTH), (PAIRS_FILE, _PAIRS), (CLIP_FRAMES_FILE, _FRAMES))
    )
    count = len(frames["frame"])
    if count == 0 or (frames["frame"] != np.arange(count)).any():
        raise DataError(
            expected=f"frames from 0 on in {CLIP_FRAMES_FILE}", found=f"others in {folder}", fix=RENDER_AGAIN
        )
    for name, table in ((TRUTH_FILE, truth), (PAIRS_FILE, pairs)):
        if len(table["frame"]) and not 0 <= table["frame"].min() <= table["frame"].max() < count:
            found = f"others in {folder / name}"
            raise DataError(
                expected=f"frames from 0 to {count - 1} as in {CLIP_FRAMES_FILE}", found=found, fix=RENDER_AGAIN
            )
    board = _board(scene, frames, folder)
    # A checkerboard is measured by its own corners; its outline is none of the paper's reference objects.
    reference = None if board is not None else _reference(scene, frames, folder)
    if reference is None and board is None:
        raise DataError(
            expected="a clip with a reference object or a checkerboard",
            found=f"neither in {folder}",
            fix="choose another preset of `standoff simulate --list`",
        )
    return _assemble(folder, scene, truth, pairs, frames, reference, board)


def read_scene(folder: Path) -> Mapping[str, Any]:
    """Read what a clip shows.

    Raises:
        DataError: There is no such file, or it is not what it should be.
    """
    path = folder / SCENE_FILE
    if not path.is_file():
        fix = "give the folder that `standoff simulate` wrote"
        raise DataError(expected="a clip folder", found=f"no {path}", fix=fix)
    scene = read_json(path, "what a clip shows")
    found = scene.get("format") if isinstance(scene, dict) else None
    if found != CLIP_FORMAT:
        raise DataError(expected=f"a clip of format {CLIP_FORMAT}", found=f"format {found} in {path}", fix=RENDER_AGAIN)
    missing = [name for name in ("preset", "seed", "entities", "reference", "board") if name not in scene]
    if missing:
        raise DataError(
            expected=f"a whole {SCENE_FILE}", found=f"{path} without {', '.join(missing)}", fix=RENDER_AGAIN
        )
    return dict(scene)


def _reference(scene: Mapping[str, Any], frames: Columns, folder: Path) -> TrueReference | None:
    entry = scene["reference"]
    if entry is None:
        return None
    corners_px = np.stack([_lists(frames[name], 4, folder, "corners") for name in _REFERENCE_PX], axis=-1)
    base_m = np.array(entry["base_m"], dtype=np.float64)
    return TrueReference(
        entity_id=int(entry["entity_id"]),
        corners_m=np.array(entry["top_m"], dtype=np.float64)[:, :2],
        # Clips from before the ground was noted stand on it all the same.
        ground_m=float(entry.get("ground_m", base_m[:, 2].mean())),
        corners_px=corners_px,
        visible_share=np.nan_to_num(frames["reference_visible_share"], nan=0.0),
        covered=frames["reference_covered"].astype(np.bool_),
    )


def _board(scene: Mapping[str, Any], frames: Columns, folder: Path) -> TrueBoard | None:
    entry = scene["board"]
    if entry is None:
        return None
    corners = len(entry["corners_m"])
    side = round(corners**0.5)
    if side * side != corners or side < 3:
        found = f"{corners} in {folder / SCENE_FILE}"
        raise DataError(expected="a square board of at least 3x3 inner corners", found=found, fix=RENDER_AGAIN)
    corners_px = np.stack([_lists(frames[f"board_{axis}_px"], corners, folder, "corners") for axis in "xy"], axis=-1)
    return TrueBoard(side, float(entry["square_m"]), corners_px.reshape(-1, side, side, 2))


def _lists(column: Any, length: int, folder: Path, what: str) -> FloatArray:  # noqa: ANN401 - objects have no type
    """Return (F, length) of a column of lists."""
    rows = [np.asarray(row, dtype=np.float64) for row in column]
    if any(len(row) != length for row in rows):
        found = f"another number in {CLIP_FRAMES_FILE} of {folder}"
        raise DataError(expected=f"{length} {what} in every frame", found=found, fix=RENDER_AGAIN)
    return np.stack(rows)


def _assemble(
    folder: Path,
    scene: Mapping[str, Any],
    truth: Columns,
    pairs: Columns,
    frames: Columns,
    reference: TrueReference | None,
    board: TrueBoard | None,
) -> Clip:
    count = len(frames["frame"])
    entity_ids, rows = np.unique(truth["entity_id"], return_inverse=True)
    names = ("x1_px", "y1_px", "x2_px", "y2_px", "x_m", "y_m", "foot_x_px", "foot_y_px")
    everything = np.full((count, len(entity_ids), len(names)), np.nan)
    columns = [truth[name] for name in names]
    everything[truth["frame"], rows] = np.column_stack(columns)
    class_id = np.zeros(len(entity_ids), dtype=np.int64)
    class_id[rows] = truth["class_id"]
    own = np.array([CLASSES[k].role is not Role.REFERENCE for k in class_id], dtype=np.bool_)
    reference_box = np.full((count, 4), np.nan)
    if reference is not None:
        of_reference = np.flatnonzero(entity_ids == reference.entity_id)
        if len(of_reference) != 1:
            raise DataError(
                expected=f"the reference object in {TRUTH_FILE}", found=f"none in {folder}", fix=RENDER_AGAIN
            )
        reference_box = everything[:, of_reference[0], :4]
    which, distance_m = _distances(pairs, entity_ids[own], class_id[own], count)
    return Clip(
        folder=folder,
        preset=str(scene["preset"]),
        seed=int(scene["seed"]),
        frame_count=count,
        entity_id=entity_ids[own].astype(np.int64),
        class_id=class_id[own],
        box_px=everything[:, own, :4],
        xy_m=everything[:, own, 4:6],
        foot_px=everything[:, own, 6:],
        camera_m=np.column_stack([frames[f"camera_{axis}_m"] for axis in "xyz"]).astype(np.float64),
        site_to_camera=_lists(frames["site_to_camera"], 9, folder, "entries of site_to_camera").reshape(-1, 3, 3),
        reference_box_px=reference_box,
        pairs=which,
        distance_m=distance_m,
        reference=reference,
        board=board,
    )


def _distances(pairs: Columns, entity_id: IntArray, class_id: IntArray, count: int) -> tuple[IntArray, FloatArray]:
    """Return (P, 2) rows of person and machine, and (F, P) their true distances."""
    person = np.array([CLASSES[k].role is Role.PERSON for k in class_id], dtype=np.bool_)
    which = np.array([(a, b) for a in np.flatnonzero(person) for b in np.flatnonzero(~person)], dtype=np.int64)
    which = which.reshape(-1, 2)
    if not np.isin([pairs["entity_a"], pairs["entity_b"]], entity_id).all():
        raise DataError(
            expected="pairs of entities of truth.parquet", found="others in pairs.parquet", fix=RENDER_AGAIN
        )
    square = np.full((count, len(entity_id), len(entity_id)), np.nan)
    first, second = (np.searchsorted(entity_id, pairs[name]) for name in ("entity_a", "entity_b"))
    square[pairs["frame"], first, second] = square[pairs["frame"], second, first] = pairs["centre_m"]
    distance_m = square[:, which[:, 0], which[:, 1]]
    # Vehicles parked in the street keep no distance to anybody.
    known = np.isfinite(distance_m).any(axis=0)
    return which[known], distance_m[:, known]
