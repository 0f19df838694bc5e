"""Networks: read Darknet's files, build them in torch, export them to ONNX. Needs the `train` extra."""

from standoff.training.architectures import yolov3_cfg, yolov3_tiny_cfg
from standoff.training.darknet_export import export_darknet

__all__ = ["export_darknet", "yolov3_cfg", "yolov3_tiny_cfg"]
