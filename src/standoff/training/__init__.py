"""Networks: read Darknet's files, build them in torch, export them to ONNX. Needs the `train` extra."""

from standoff.training.architectures import efficientnet_lite0_cfg, yolo_fastest_xl_cfg, yolov3_cfg, yolov3_tiny_cfg
from standoff.training.darknet.export import export_darknet

__all__ = ["efficientnet_lite0_cfg", "export_darknet", "yolo_fastest_xl_cfg", "yolov3_cfg", "yolov3_tiny_cfg"]
