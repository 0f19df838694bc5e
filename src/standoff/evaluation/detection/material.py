"""What detectors are tried on: labelled pictures, a simulated clip, or a video with boxes of people."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np

from standoff.clips import TRUTH_FILE, Clip, load_clip, read_clip_table
from standoff.core.boxes import unknown_points
from standoff.core.classes import CLASS_BY_NAME
from standoff.core.errors import ConfigError, DataError
from standoff.core.homography import BoolArray, FloatArray
from standoff.core.pose import View
from standoff.core.types import Frame, IntArray
from standoff.evaluation.positions_input import read_truth
from standoff.labels import load_picture, read_data
from standoff.labels.marking import would_be_marked
from standoff.labels.problems import readable_pictures
from standoff.labels.site_classes import to_site_classes
from standoff.labels.splits import spread_rows
from standoff.labels.types import LabelledPicture, Problem, Split
from standoff.labels.views import GroundView, views_of
from standoff.stages.frames import frame_from_array, open_source
from standoff.stages.ground import load_camera

_VISIBLE = (
    *("frame", "entity_id", "class_id", "x1_px", "y1_px", "x2_px", "y2_px", "visible_share", "visible_px"),
    *("foot_x_px", "foot_y_px"),
)


@dataclass(frozen=True, slots=True, eq=False)
class Material:
    """Pictures with what is in them; class ids are those of `CLASSES`.

    Attributes:
        name: For people.
        truth: Of each picture.
        frames: Starts to read the pictures, in the order of `truth`.
        frame_index: (N,) position of each in its video; of each picture in the split without one.
        clip: The simulated clip that they are from; None otherwise.
        problems: Of the labels and the pictures; what is left out is in no other field.
        is_whole: All splits of a data set.
        views: How pictures show the ground, by their position in `truth`; those of which nobody knows are missing.
    """

    name: str
    truth: tuple[LabelledPicture, ...]
    frames: Callable[[], Iterator[Frame]]
    frame_index: IntArray
    clip: Clip | None = None
    problems: tuple[Problem, ...] = ()
    is_whole: bool = False
    views: Mapping[int, GroundView] = field(default_factory=dict)

    @property
    def knows_points(self) -> bool:
        """Whether a true ground point is marked in any picture."""
        return any(np.isfinite(picture.foot_px).any() for picture in self.truth)


def labelled_pictures(
    path: Path,
    split: Split | Literal["all"] | None,
    limit: int | None = None,
    on_picture: Callable[[], None] = lambda: None,
) -> Material:
    """Take one split of a data set, less the pictures that cannot be decoded.

    Args:
        path: What `standoff.labels.read_data` reads.
        split: Which; "all" of it; None: "test", but "all" where nothing says what is held out.
        limit: Take so many pictures only, evenly spread; None: all.
        on_picture: Called after each one that was tried.

    Raises:
        DataError: It cannot be read, or the split has no picture that can be decoded.
    """
    data = to_site_classes(read_data(path))
    split = split or ("test" if data.is_divided else "all")
    if split == "all":
        pictures = tuple(sorted(chain.from_iterable(data.splits.values()), key=lambda picture: picture.path))
    else:
        pictures = data.splits[split]
    if not pictures:
        counts = ", ".join(f"{len(some)} in {name}" for name, some in data.splits.items() if some)
        raise DataError(
            expected=f"pictures in the split {split} of {path}",
            found=counts or "no picture at all",
            fix="choose another split with --split" if counts else "check the path",
        )
    rows = spread_rows(len(pictures), limit)
    truth, unreadable = readable_pictures([pictures[row] for row in rows], on_picture)
    if not truth:
        raise DataError(
            expected=f"pictures in the split {split} of {path} that can be decoded",
            found=f"none of {len(rows)}, the first {unreadable[0]}",
            fix="restore the files",
        )
    left_out = {problem.path for problem in unreadable}
    chosen = np.array([row for row in rows if pictures[row].path not in left_out], dtype=np.int64)

    def frames() -> Iterator[Frame]:
        for index, picture in enumerate(truth):
            yield frame_from_array(load_picture(picture), index=index, stream_id=picture.path.name)

    name = f"{path.resolve().name}, {split}"
    problems = (*data.problems, *unreadable)
    views = views_of([picture.path for picture in truth])
    return Material(name, truth, frames, chosen, problems=problems, is_whole=split == "all", views=views)


def simulated_clip(folder: Path, limit: int | None = None) -> Material:
    """Take a folder that `standoff simulate` wrote.

    Args:
        folder: Of the clip.
        limit: Take so many frames only, evenly spread; None: all.

    Raises:
        DataError: It is not a clip.
        SourceError: Its video cannot be read.
    """
    clip = load_clip(folder)
    rows = read_clip_table(folder, TRUTH_FILE, _VISIBLE)
    seen = rows["visible_px"] > 0
    boxes_px = np.column_stack([rows[name] for name in ("x1_px", "y1_px", "x2_px", "y2_px")]).astype(np.float64)
    foot_px = np.column_stack([rows["foot_x_px"], rows["foot_y_px"]]).astype(np.float64)
    ignored = ~would_be_marked(boxes_px, rows["visible_px"], rows["visible_share"])
    chosen = spread_rows(clip.frame_count, limit)
    size_px = _size_px(clip.video)
    truth = []
    for frame in chosen:
        here = seen & (rows["frame"] == frame)
        boxes = _Boxes(boxes_px[here], rows["class_id"][here], ignored[here], foot_px[here])
        truth.append(_in_video(clip.video, size_px, boxes))
    camera = load_camera(clip.camera_file)
    views = {
        position: GroundView(View(camera, clip.camera_m[frame], clip.site_to_camera[frame]), 0.0)
        for position, frame in enumerate(chosen.tolist())
    }
    return Material(clip.name, tuple(truth), lambda: _video_frames(clip.video, chosen), chosen, clip, views=views)


def video_with_people(
    csv: Path, video: Path, frames: tuple[int, int] | None = None, limit: int | None = None
) -> Material:
    """Take a video with a MOT table of people.

    Args:
        csv: `frame,id,x,y,w,h,conf,X,Y`, frames from 1; what has conf 0 is ignored.
        video: It belongs to.
        frames: First and last to take; None: all between the first and the last of the table.
        limit: Take so many frames only, evenly spread; None: all.

    Raises:
        DataError: The table cannot be read, or has no boxes or nobody in these frames.
        SourceError: The video cannot be read.
    """
    rows = read_truth(csv)
    told = rows["frame"] if len(rows["frame"]) else np.ones(1)
    first, last = frames or (int(told.min()), int(told.max()))
    inside = (rows["frame"] >= first) & (rows["frame"] <= last) & np.isfinite(rows["x"])
    if not (inside & (rows["conf"] > 0)).any():
        raise DataError(
            expected=f"boxes of people in the frames {first}-{last} of {csv}",
            found="none",
            fix="choose other frames with --frames, or another file",
        )
    boxes_px = np.column_stack([rows["x"], rows["y"], rows["x"] + rows["w"], rows["y"] + rows["h"]])
    people = np.full(len(boxes_px), CLASS_BY_NAME["worker"].id)
    chosen = spread_rows(last - first + 1, limit) + first - 1
    size_px = _size_px(video)
    truth = []
    for frame in chosen:
        here = inside & (rows["frame"] == frame + 1)
        nowhere_px = unknown_points(int(here.sum()))
        boxes = _Boxes(boxes_px[here], people[here], rows["conf"][here] <= 0, nowhere_px)
        truth.append(_in_video(video, size_px, boxes))
    return Material(f"{video.name}, frames {first}-{last}", tuple(truth), lambda: _video_frames(video, chosen), chosen)


def open_material(
    path: Path,
    *,
    split: Split | Literal["all"] | None,
    video: Path | None,
    frames: tuple[int, int] | None,
    limit: int | None,
    on_picture: Callable[[], None] = lambda: None,
) -> Material:
    """Take whatever kind of data there is at a path: a clip folder, a CSV table with its video, or labelled pictures.

    Raises:
        ConfigError: A table has no video, or a video or a choice of frames has no table.
        DataError: The data cannot be used.
        SourceError: The video cannot be read.
    """
    if path.suffix.lower() == ".csv":
        if video is None:
            raise ConfigError(expected=f"--video FILE with {path}", found="none", fix="say which video it belongs to")
        return video_with_people(path, video, frames, limit)
    if video is not None or frames is not None:
        raise ConfigError(
            expected="a CSV table with --video and --frames", found=f"{path}", fix="leave --video and --frames out"
        )
    if (path / TRUTH_FILE).is_file():
        return simulated_clip(path, limit)
    return labelled_pictures(path, split, limit, on_picture)


def _size_px(video: Path) -> tuple[int, int]:
    with open_source(video) as source:
        return source.size_px


class _Boxes(NamedTuple):
    """What is in a frame: (N, 4), (N,), (N,), and (N, 2) ground points."""

    xyxy_px: FloatArray
    class_id: IntArray
    ignored: BoolArray
    foot_px: FloatArray


def _in_video(video: Path, size_px: tuple[int, int], boxes: _Boxes) -> LabelledPicture:
    """Return a frame of a video, its boxes clipped to the picture, those outside it left out."""
    edges_px = np.array([*size_px, *size_px]) - 0.5
    inside_px = np.clip(boxes.xyxy_px, -0.5, edges_px)
    kept = (inside_px[:, 2:] > inside_px[:, :2]).all(axis=1)
    return LabelledPicture(
        path=video,
        size_px=size_px,
        xyxy_px=inside_px[kept],
        class_id=boxes.class_id[kept].astype(np.int64),
        ignored=boxes.ignored[kept],
        foot_px=boxes.foot_px[kept],
        group=video.stem,
        source=video.stem,
    )


def _video_frames(video: Path, chosen: IntArray) -> Iterator[Frame]:
    wanted = set(chosen.tolist())
    with open_source(video) as source:
        for frame in source:
            if frame.index in wanted:
                yield frame
            if frame.index >= chosen[-1]:
                return
