"""Settings of the detector."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Literal

from annotated_types import Ge, Interval
from typing_extensions import Doc

from standoff.core.class_map import IGNORE
from standoff.core.classes import CLASS_BY_NAME

Provider = Literal["auto", "cpu", "cuda", "tensorrt", "openvino"]


@dataclass(frozen=True, slots=True)
class DetectParams:
    """Settings of the detector."""

    score_threshold: Annotated[
        float,
        Interval(ge=0, le=1),
        Doc("Boxes at least this sure are passed on. Low, because the tracker sorts sure from unsure boxes itself."),
    ] = 0.1
    class_score_thresholds: Annotated[
        Mapping[str, float],
        Doc("Another threshold for some of the site's classes, by name, 0 to 1. None by default."),
    ] = field(default_factory=dict)
    nms_iou: Annotated[
        float,
        Interval(ge=0, le=1),
        Doc(
            "Of two boxes of one class that overlap more (intersection over union) the surer stays. 0.45 in Darknet; "
            "of a worker 30 px tall, heads of different strides give boxes that overlap less."
        ),
    ] = 0.3
    max_detections: Annotated[
        int, Ge(1), Doc("The surest boxes of a frame that are kept; far above what a site shows.")
    ] = 300
    class_map: Annotated[
        Mapping[str, str],
        Doc("Model label to site class, or to 'ignore'; goes before the built-in map (person to worker, ...)."),
    ] = field(default_factory=dict)
    slices: Annotated[
        tuple[int, int],
        Doc("Columns and rows of overlapping slices seen one by one besides the whole frame; (1, 1) is none."),
    ] = (1, 1)
    slice_overlap: Annotated[
        float,
        Interval(ge=0, lt=0.9),
        Doc("Part of a slice's side shared with its neighbour; a fifth holds what is small enough to need slices."),
    ] = 0.2
    cut_overlap: Annotated[
        float,
        Interval(gt=0, le=1),
        Doc("A box cut by a slice's border is part of one that holds this much of the smaller of the two."),
    ] = 0.6
    ground_points: Annotated[
        str,
        Doc(
            "Small network that tells where the things in the boxes stand, if the detector does not: 'site', the "
            "two that come with standoff; 'none': then where things of a class usually stand; or an ONNX file."
        ),
    ] = "site"
    provider: Annotated[Provider, Doc("What computes; 'auto' takes CUDA where ONNX Runtime has it, else the CPU.")] = (
        "auto"
    )
    intra_op_threads: Annotated[
        int, Ge(0), Doc("Threads of the inference on the CPU; 0 lets ONNX Runtime take one for each core.")
    ] = 0

    def __post_init__(self) -> None:
        for label, name in self.class_map.items():
            if name not in CLASS_BY_NAME and name != IGNORE:
                known = ", ".join([*CLASS_BY_NAME, IGNORE])
                raise ValueError(f"class_map sends '{label}' to '{name}', which is none of {known}")
        for name, threshold in self.class_score_thresholds.items():
            if name not in CLASS_BY_NAME:
                raise ValueError(f"class_score_thresholds names '{name}', which is none of {', '.join(CLASS_BY_NAME)}")
            if not 0 <= threshold <= 1:
                raise ValueError(f"class_score_thresholds of '{name}' must lie between 0 and 1, not {threshold:g}")
        if min(self.slices) < 1:
            raise ValueError(f"slices must be at least (1, 1), not {self.slices}")
