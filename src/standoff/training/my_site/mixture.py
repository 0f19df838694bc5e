"""One site's labelled frames beside a few rendered pictures, as one mixture that makes a detector forget little.

Two things make a network forget when it goes on with the frames of one site: what they do not show, and what their
owner did not label. Against the first, pictures of what it learnt before are shown in between (replay). Against the
second, whatever the network itself sees of classes that the labels do not have counts neither way.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from importlib.resources import files
from pathlib import Path
from typing import Any, Final

from standoff.core.class_map import IGNORE
from standoff.core.classes import CLASS_BY_NAME, CLASSES
from standoff.core.errors import DataError
from standoff.files.whole import make_folder
from standoff.files.yaml_text import write_yaml
from standoff.labels import LabelledData, LabelledPicture, load_picture, read_data
from standoff.labels.regions import OWN_REGIONS
from standoff.labels.site_classes import site_names
from standoff.stages.detect import DetectParams, OnnxDetector, find_model
from standoff.stages.frames import frame_from_array
from standoff.training.run.plan import RunPlan
from standoff.training.run.training_folder import PREPARED_DATA, refuse_used

_REPLAY_SHARE: Final = 0.3
"""Of the pictures that training draws."""

_UNLABELLED_SCORE: Final = 0.2
"""What the detector finds so surely of a class that nobody labelled is left alone."""


def replay_folder() -> Path:
    """Return the folder of the rendered pictures that come with standoff."""
    return Path(str(files("standoff.training.my_site"))) / "replay"


def prepare_plan(plan: RunPlan, out: Path, say: Callable[[str], None]) -> RunPlan:
    """Write a mixture of one site's frames and replayed pictures.

    Args:
        plan: Its data are the frames: a YOLO, COCO or Pascal VOC data set. Labels that are no class of the site are
            ignored.
        out: Folder of the run; the mixture comes into its folder `data`.
        say: Told what people should know.

    Returns:
        The plan with the mixture as its data. Frames of one flight are all trained on: then no validation chooses
        between steps, because that would choose whatever has changed least.

    Raises:
        DataError: The frames cannot be read, or none of their labels is a class of the site.
        OutputError: The folder holds a run, or cannot be written.
    """
    refuse_used(out)
    own = read_data(plan.data)
    mapped = site_names(own.classes, fix="name the classes as the site's, or give --config")
    class_map = {label: mapped.get(label, IGNORE) for label in own.classes}
    absent = [one.name for one in CLASSES if one.name not in class_map.values()]
    pictures = [picture for pictures in own.splits.values() for picture in pictures]
    if absent:
        say(f"not among the labels: {', '.join(absent)}; where the detector sees one, the frames say nothing")
    regions = _unlabelled(pictures, absent) if absent else {}
    holds_out = len({picture.group for picture in pictures}) > 1
    if not holds_out:
        say("all frames are of one flight: none is held out, so that only forgetting can be measured")
    content = _mixture(plan.data, own, class_map, holds_out=holds_out)
    folder = out / PREPARED_DATA
    make_folder(folder)
    write_yaml(folder / OWN_REGIONS, regions)
    write_yaml(folder / "mixture.yaml", content)
    params = plan.params if holds_out else replace(plan.params, validate_every=plan.params.steps)
    return replace(plan, data=folder / "mixture.yaml", params=params)


def _unlabelled(pictures: Sequence[LabelledPicture], absent: Sequence[str]) -> dict[str, list[list[float]]]:
    """Return by the stem of each picture the boxes that are ignored in it, those of its own labels included."""
    ids = [CLASS_BY_NAME[name].id for name in absent]
    params = DetectParams(score_threshold=_UNLABELLED_SCORE, ground_points="none")
    detector = OnnxDetector(find_model("site"), params)
    regions: dict[str, list[list[float]]] = {}
    for picture in pictures:
        ignored = picture.xyxy_px[picture.ignored].tolist()
        try:
            frame = frame_from_array(load_picture(picture))
        except DataError:
            # Training names it and goes on without it.
            continue
        found = detector.detect(frame)
        ignored += [
            box for box, class_id in zip(found.xyxy_px.tolist(), found.class_id, strict=True) if class_id in ids
        ]
        if ignored:
            regions[picture.path.stem] = [[round(value, 1) for value in box] for box in ignored]
    return regions


def _mixture(labelled: Path, own: LabelledData, class_map: dict[str, str], *, holds_out: bool) -> dict[str, Any]:
    site: dict[str, Any] = {"path": str(labelled.resolve()), "name": "site", "class_map": class_map}
    site["ignore_regions"] = OWN_REGIONS
    if not holds_out:
        site["split"] = "train"
    replayed = replay_folder()
    frames = max(len(own.splits["train"]), 1)
    weight = _REPLAY_SHARE / (1.0 - _REPLAY_SHARE) * frames / len(list((replayed / "images" / "train").iterdir()))
    replay = {"path": str(replayed / "data.yaml"), "name": "replay", "weight": round(weight, 3)}
    return {"classes": [one.name for one in CLASSES], "sources": [site, replay]}
