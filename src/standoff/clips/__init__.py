"""What lies in the folder of a run, for those who write it and those who read it again.

>>> from standoff.clips import read_detections
>>> recorded = read_detections("out")  # doctest: +SKIP
>>> recorded.detections_at(recorded.row_of(12))  # doctest: +SKIP
"""

from standoff.clips.detections import (
    COLUMNS,
    DETECTIONS_FILE,
    FOOT_COLUMNS,
    RecordedDetections,
    is_recording,
    metadata_of,
    read_detections,
)

__all__ = [
    "COLUMNS",
    "DETECTIONS_FILE",
    "FOOT_COLUMNS",
    "RecordedDetections",
    "is_recording",
    "metadata_of",
    "read_detections",
]
