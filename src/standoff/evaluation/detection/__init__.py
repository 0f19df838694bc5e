"""How good detectors are on labelled pictures: the paper's mAP, average IoU and ALE, and COCO's figures.

from standoff.evaluation.detection import score_detections

score = score_detections(truth, found, classes)
print(score.mean_ap11, score.average_iou, score.of("worker").recall_at_precision(0.8))
"""

from standoff.evaluation.detection.curve import Curve
from standoff.evaluation.detection.score import ClassScore, DetectionScore, score_detections

__all__ = ["ClassScore", "Curve", "DetectionScore", "score_detections"]
