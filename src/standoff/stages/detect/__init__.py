"""From pixels to boxes: letterbox, slices, ONNX Runtime, suppression of duplicates.

>>> from standoff.stages.detect import OnnxDetector, DetectParams
>>> detector = OnnxDetector("model.onnx", DetectParams(score_threshold=0.3))  # doctest: +SKIP
>>> detections = detector.detect(frame)  # doctest: +SKIP
"""

from standoff.stages.detect.class_map import DEFAULT_CLASS_MAP
from standoff.stages.detect.detector import OnnxDetector
from standoff.stages.detect.params import DetectParams
from standoff.stages.detect.recorded import RecordedDetector
from standoff.stages.detect.runtime import available_providers
from standoff.stages.detect.shared import SharedDetector
from standoff.stages.detect.shipped import SHIPPED_MODELS, ShippedModel, find_model

__all__ = [
    "DEFAULT_CLASS_MAP",
    "SHIPPED_MODELS",
    "DetectParams",
    "OnnxDetector",
    "RecordedDetector",
    "SharedDetector",
    "ShippedModel",
    "available_providers",
    "find_model",
]
