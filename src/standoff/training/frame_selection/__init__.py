"""Frames of a video that are worth labelling: those on which the detector is unsure, and no two alike.

from standoff.training.frame_selection import SelectionParams, label_frames

label_frames(Path("site.mp4"), detector, Path("to-label"), SelectionParams(frames=100), progress)
"""

from standoff.training.frame_selection.export import LabelPlan, LabelReport, label_frames
from standoff.training.frame_selection.selection import Choice, SelectionParams, choose

__all__ = ["Choice", "LabelPlan", "LabelReport", "SelectionParams", "choose", "label_frames"]
