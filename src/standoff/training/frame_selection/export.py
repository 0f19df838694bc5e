"""Write chosen frames for people to label: pictures, the detector's boxes as a start, and a sheet to look at."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal

import cv2
from annotated_types import Ge, Gt
from typing_extensions import Doc

from standoff.core.classes import CLASSES
from standoff.core.errors import OutputError
from standoff.core.protocols import Detector
from standoff.core.types import Frame, ImageArray
from standoff.labels.proposals import ProposedPicture, write_coco, write_label_studio
from standoff.stages.frames import FileSource, open_source
from standoff.training.frame_selection.candidates import look_through
from standoff.training.frame_selection.contact_sheet import Tile, draw_sheet
from standoff.training.frame_selection.selection import Choice, SelectionParams, choose

Format = Literal["coco", "label-studio", "both"]
Progress = Callable[[str, int | None], AbstractContextManager[Callable[[], None]]]
"""Of a task, its name and number of steps, if known; gives what is to be called after each step."""

_LOOKED_AT_FOR_ONE = 10
"""Candidates for each frame wanted: enough to choose from."""
_DEFAULT_EVERY_S = 1.0
"""Between candidates where the source does not tell how long it is."""
_JPEG_QUALITY = 95
_PICTURES = "images"
LABEL_FILES = (_PICTURES, "coco.json", "label_studio.json", "contact_sheet.png")
"""What the folder holds."""


@dataclass(frozen=True, slots=True)
class LabelPlan:
    """What is looked at and written.

    Attributes:
        source: Video file or folder of pictures.
        selection: What is chosen.
        every_s: Time between frames that are looked at; None: ten times as many as are wanted.
        fps: Pictures a second of a folder.
        format: Of the proposed boxes.
        wanted: Times of frames that are chosen before all others, and why.
    """

    source: Path
    selection: SelectionParams
    every_s: Annotated[float, Ge(0), Doc("Seconds.")] | None = None
    fps: Annotated[float, Gt(0), Doc("Needed for a folder.")] | None = None
    format: Format = "both"
    wanted: Mapping[float, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, eq=False)
class LabelReport:
    """What became of it.

    Attributes:
        looked_at: Candidates.
        choices: The frames that were written, in the order of time.
        boxes: Proposed on them.
        anything_seen: False if the detector saw nothing in any candidate.
    """

    looked_at: int
    choices: tuple[Choice, ...]
    boxes: int
    anything_seen: bool


def label_frames(plan: LabelPlan, detector: Detector, folder: Path, progress: Progress) -> LabelReport:
    """Choose frames of a source and write them with the detector's boxes.

    Args:
        plan: What is wanted.
        detector: With a low score threshold: what it is unsure of matters.
        folder: Empty; takes `images/`, `coco.json`, `label_studio.json` and `contact_sheet.png`.
        progress: Shows what takes long.

    Raises:
        SourceError: The source cannot be read.
        OutputError: The folder cannot be written to.
    """
    threshold = plan.selection.threshold
    with open_source(plan.source, fps=plan.fps) as source, progress("looking", source.frame_count) as step:
        every_s = _every_s(plan, source)
        candidates = list(look_through(_counted(source, step), detector, every_s, threshold, plan.wanted))
    choices = choose(candidates, plan.selection)
    proposals, tiles = [], []
    (folder / _PICTURES).mkdir()
    with progress("writing", len(choices)) as step:
        for choice, frame in _again(plan, choices):
            boxes = choice.candidate.detections
            boxes = boxes[boxes.score >= threshold]
            name = f"{plan.source.stem}_{frame.index:06d}.jpg"
            _write(folder / _PICTURES / name, frame.image, [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])
            proposals.append(ProposedPicture(name, frame.size_px, boxes))
            tiles.append(Tile.of(frame, boxes, choice.reason))
            step()
    classes = [site_class.name for site_class in CLASSES]
    if plan.format != "label-studio":
        write_coco(proposals, classes, folder / "coco.json")
    if plan.format != "coco":
        url_prefix = f"/data/local-files/?d={_PICTURES}/"
        write_label_studio(proposals, classes, folder / "label_studio.json", url_prefix=url_prefix)
    _write(folder / "contact_sheet.png", draw_sheet(tiles), [])
    seen = any(len(candidate.detections) for candidate in candidates)
    return LabelReport(len(candidates), tuple(choices), sum(len(one.boxes) for one in proposals), seen)


def _every_s(plan: LabelPlan, source: FileSource) -> float:
    if plan.every_s is not None:
        return plan.every_s
    duration_s = source.describe()["duration_s"]
    return duration_s / (_LOOKED_AT_FOR_ONE * plan.selection.frames) if duration_s else _DEFAULT_EVERY_S


def _counted(source: FileSource, step: Callable[[], None]) -> Iterator[Frame]:
    for frame in source:
        yield frame
        step()


def _again(plan: LabelPlan, choices: list[Choice]) -> Iterator[tuple[Choice, Frame]]:
    """Read the chosen frames once more: kept from the first time, they would fill the memory."""
    waiting = iter(choices)
    wanted = next(waiting, None)
    with open_source(plan.source, fps=plan.fps) as source:
        for frame in source:
            if wanted is None:
                return
            if frame.index == wanted.candidate.index:
                yield wanted, frame
                wanted = next(waiting, None)


def _write(path: Path, image: ImageArray, options: list[int]) -> None:
    coded, data = cv2.imencode(path.suffix, image, options)
    try:
        if not coded:
            raise OSError(f"OpenCV cannot write {path.suffix}")
        path.write_bytes(data.tobytes())
    except OSError as error:
        raise OutputError(
            expected=f"a place to write {path.name}", found=error.strerror or str(error), fix="make room"
        ) from error
