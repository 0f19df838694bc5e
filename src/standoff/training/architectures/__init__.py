"""Networks composed as Darknet cfg text, for any number of classes, input size and anchors."""

from standoff.training.architectures.composer import Anchors
from standoff.training.architectures.efficientnet_lite import efficientnet_lite0_cfg
from standoff.training.architectures.named import ARCHITECTURES, Architecture
from standoff.training.architectures.yolo_fastest import yolo_fastest_xl_cfg
from standoff.training.architectures.yolov3 import yolov3_cfg, yolov3_tiny_cfg

__all__ = [
    "ARCHITECTURES",
    "Anchors",
    "Architecture",
    "efficientnet_lite0_cfg",
    "yolo_fastest_xl_cfg",
    "yolov3_cfg",
    "yolov3_tiny_cfg",
]
