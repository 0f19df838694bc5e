"""Frames of a video that are worth labelling: those on which the detector is unsure, and no two alike.

from standoff.training.frame_selection import LabelPlan, SelectionParams, label_frames

label_frames(LabelPlan(Path("site.mp4"), SelectionParams(frames=100)), detector, Path("to-label"), progress)
"""

from standoff.training.frame_selection.export import LABEL_FILES, LabelPlan, LabelReport, label_frames
from standoff.training.frame_selection.selection import Choice, SelectionParams, choose

__all__ = ["LABEL_FILES", "Choice", "LabelPlan", "LabelReport", "SelectionParams", "choose", "label_frames"]
