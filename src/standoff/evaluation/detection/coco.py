"""COCO's figures, computed by pycocotools: AP, AP50, AP75, by area, and AP50 by height."""

from __future__ import annotations

import contextlib
import io
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from importlib.util import find_spec
from typing import Any

import numpy as np

from standoff.core.errors import MissingDependency
from standoff.core.homography import FloatArray
from standoff.core.types import Detections
from standoff.labels.types import LabelledPicture

HEIGHT_BANDS_PX = ((8.0, 15.0), (15.0, 30.0), (30.0, 60.0), (60.0, float("inf")))
"""Heights of boxes, from and below; people in drone video are 10 to 45 px tall."""

_AREAS_PX2 = ((0.0, 1e10), (0.0, 32.0**2), (32.0**2, 96.0**2), (96.0**2, 1e10))
"""All, small, medium, large, as COCO has them."""
MOST_OF_A_CLASS = 100
_EVERY_IOU = np.linspace(0.5, 0.95, 10)
_AP50, _AP75 = 0, 5


@dataclass(frozen=True, slots=True)
class CocoClass:
    """COCO's figures of one class; NaN where there is no such truth.

    Attributes:
        name: Of the class.
        ap: Mean over the IoUs 0.50, 0.55 ... 0.95 of 101-point AP.
        ap50: At IoU 0.5.
        ap75: At IoU 0.75.
        ap_small: `ap` of boxes up to 32 x 32 px.
        ap_medium: From there to 96 x 96 px.
        ap_large: From there.
        ap50_by_height: AP50 in each of `HEIGHT_BANDS_PX`.
        truths_by_height: How many boxes are in each.
    """

    name: str
    ap: float
    ap50: float
    ap75: float
    ap_small: float
    ap_medium: float
    ap_large: float
    ap50_by_height: tuple[float, ...]
    truths_by_height: tuple[int, ...]


_MEANS = ("ap", "ap50", "ap75", "ap_small", "ap_medium", "ap_large")


@dataclass(frozen=True, slots=True)
class CocoFigures:
    """COCO's figures of all classes, and their means over the classes that have such truth.

    Attributes:
        classes: In the order of the class list.
    """

    classes: tuple[CocoClass, ...]

    def mean(self, name: str) -> float:
        """Return the mean over classes of "ap", "ap50", "ap75", "ap_small", "ap_medium" or "ap_large"."""
        values = np.array([getattr(figures, name) for figures in self.classes])
        known = values[np.isfinite(values)]
        return float(known.mean()) if len(known) else float("nan")

    def to_dict(self) -> dict[str, Any]:
        """Return plain values; NaN stays NaN."""
        return {
            **{name: self.mean(name) for name in _MEANS},
            "height_bands_px": HEIGHT_BANDS_PX,
            "classes": [asdict(figures) for figures in self.classes],
        }


def require_pycocotools() -> None:
    """Check that pycocotools is installed.

    Raises:
        MissingDependency: It is not.
    """
    if find_spec("pycocotools") is None:
        raise MissingDependency(
            expected="pycocotools, which computes COCO's figures",
            found="none",
            fix="run: pip install 'standoff[train]'",
        )


def coco_figures(
    truth: Sequence[LabelledPicture], found: Sequence[Detections], classes: tuple[str, ...]
) -> CocoFigures:
    """Score detections as COCO does; an ignored region is a crowd of every class.

    Args:
        truth: Pictures and what is in them.
        found: What was detected in each, low scores included; `class_id` is a position in `classes`. The 100 surest of
            each class in a picture count.
        classes: Names.

    Raises:
        MissingDependency: pycocotools is not installed.
    """
    require_pycocotools()
    boxes, guesses = _truth_rows(truth, len(classes)), _found_rows(found)
    areas = _AREAS_PX2
    heights = tuple((low_px**2, np.nextafter(high_px**2, 0.0)) for low_px, high_px in HEIGHT_BANDS_PX)
    by_area = _average_precisions((boxes, guesses), (len(truth), len(classes)), _EVERY_IOU, areas)
    # COCO sorts boxes into bands by what it is told is their area: the height squared does as well.
    by_height = _average_precisions(
        (_as_tall(boxes), _as_tall(guesses)), (len(truth), len(classes)), _EVERY_IOU[:1], heights
    )
    return CocoFigures(
        tuple(
            CocoClass(
                name=name,
                ap=float(by_area[:, k, 0].mean()),
                ap50=float(by_area[_AP50, k, 0]),
                ap75=float(by_area[_AP75, k, 0]),
                ap_small=float(by_area[:, k, 1].mean()),
                ap_medium=float(by_area[:, k, 2].mean()),
                ap_large=float(by_area[:, k, 3].mean()),
                ap50_by_height=tuple(by_height[0, k].tolist()),
                truths_by_height=_count_by_height(truth, k),
            )
            for k, name in enumerate(classes)
        )
    )


def _count_by_height(truth: Sequence[LabelledPicture], class_id: int) -> tuple[int, ...]:
    own = [one.xyxy_px[(one.class_id == class_id) & ~one.ignored] for one in truth]
    heights_px = np.concatenate([np.zeros(0), *(boxes_px[:, 3] - boxes_px[:, 1] for boxes_px in own)])
    return tuple(int(((heights_px >= low) & (heights_px < high)).sum()) for low, high in HEIGHT_BANDS_PX)


def _truth_rows(truth: Sequence[LabelledPicture], classes: int) -> list[dict[str, Any]]:
    rows = [
        _row(image_id, class_id, box_px) | {"iscrowd": int(ignored)}
        for image_id, picture in enumerate(truth)
        for box_px, own_class, ignored in zip(
            picture.xyxy_px.tolist(), picture.class_id.tolist(), picture.ignored.tolist(), strict=True
        )
        for class_id in (range(classes) if ignored else (own_class,))
    ]
    return _numbered(rows)


def _found_rows(found: Sequence[Detections]) -> list[dict[str, Any]]:
    rows = [
        _row(image_id, class_id, box_px) | {"score": score}
        for image_id, detections in enumerate(found)
        for box_px, class_id, score in zip(
            detections.xyxy_px.tolist(), detections.class_id.tolist(), detections.score.tolist(), strict=True
        )
    ]
    return _numbered(rows)


def _row(image_id: int, class_id: int, box_px: list[float]) -> dict[str, Any]:
    left, top, right, bottom = box_px
    width_px, height_px = right - left, bottom - top
    return {
        "image_id": image_id,
        "category_id": class_id,
        "bbox": [left, top, width_px, height_px],
        "area": width_px * height_px,
    }


def _numbered(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    # COCO takes id 0 for "none".
    return [row | {"id": number} for number, row in enumerate(rows, start=1)]


def _as_tall(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    return [row | {"area": row["bbox"][3] ** 2} for row in rows]


def _average_precisions(
    rows: tuple[list[dict[str, Any]], list[dict[str, Any]]],
    counts: tuple[int, int],
    ious: FloatArray,
    areas: Sequence[tuple[float, float]],
) -> FloatArray:
    """Return (I, C, A) 101-point AP at each IoU, of each class, in each range of areas; NaN without such truth."""
    from pycocotools.coco import COCO
    from pycocotools.cocoeval import COCOeval

    # pycocotools talks to standard output.
    with contextlib.redirect_stdout(io.StringIO()):
        sides = []
        for annotations in rows:
            side = COCO()
            side.dataset = {
                "images": [{"id": number} for number in range(counts[0])],
                "categories": [{"id": number} for number in range(counts[1])],
                "annotations": annotations,
            }
            side.createIndex()
            sides.append(side)
        evaluation = COCOeval(*sides, "bbox")
        evaluation.params.iouThrs = ious
        evaluation.params.areaRng = [list(area) for area in areas]
        evaluation.params.areaRngLbl = [str(number) for number in range(len(areas))]
        evaluation.params.maxDets = [MOST_OF_A_CLASS]
        evaluation.evaluate()
        evaluation.accumulate()
    precision: FloatArray = evaluation.eval["precision"][..., 0]
    return np.where((precision < 0).any(axis=1), np.nan, precision.mean(axis=1))
