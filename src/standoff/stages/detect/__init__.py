"""From pixels to boxes: letterbox, slices, ONNX Runtime, suppression of duplicates.

>>> from standoff.stages.detect import OnnxDetector, DetectParams
>>> detector = OnnxDetector("model.onnx", DetectParams(score_threshold=0.3))  # doctest: +SKIP
>>> detections = detector.detect(frame)  # doctest: +SKIP
"""

from standoff.stages.detect.candidates import Candidates
from standoff.stages.detect.decoded_rows import detections_in_rows
from standoff.stages.detect.detector import OnnxDetector
from standoff.stages.detect.letterbox import Letterbox, resize
from standoff.stages.detect.model_card import BOXES_OUTPUT, PICTURE_INPUT, POINTS_OUTPUT, ModelCard
from standoff.stages.detect.network import Network
from standoff.stages.detect.params import DetectParams, Provider
from standoff.stages.detect.point_crops import (
    POINT_CLASSES,
    POINT_CROP_AROUND,
    POINT_CROP_PX,
    point_crop,
    point_squares_px,
)
from standoff.stages.detect.point_network import CLASS_INPUT, CROPS_INPUT, point_metadata
from standoff.stages.detect.recorded import RecordedDetector
from standoff.stages.detect.remembering import RememberingDetector
from standoff.stages.detect.runtime import ONNX_ERRORS, available_providers, open_session
from standoff.stages.detect.shared import SharedDetector
from standoff.stages.detect.shipped import SHIPPED_MODELS, ShippedModel, find_ground_points, find_model

__all__ = [
    "BOXES_OUTPUT",
    "CLASS_INPUT",
    "CROPS_INPUT",
    "ONNX_ERRORS",
    "PICTURE_INPUT",
    "POINTS_OUTPUT",
    "POINT_CLASSES",
    "POINT_CROP_AROUND",
    "POINT_CROP_PX",
    "SHIPPED_MODELS",
    "Candidates",
    "DetectParams",
    "Letterbox",
    "ModelCard",
    "Network",
    "OnnxDetector",
    "Provider",
    "RecordedDetector",
    "RememberingDetector",
    "SharedDetector",
    "ShippedModel",
    "available_providers",
    "detections_in_rows",
    "find_ground_points",
    "find_model",
    "open_session",
    "point_crop",
    "point_metadata",
    "point_squares_px",
    "resize",
]
