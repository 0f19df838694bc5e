"""What lies in the folders of runs and of clips with exact truth, for those who write it and those who read it again.

>>> from standoff.clips import load_clip, read_detections
>>> recorded = read_detections("out")  # doctest: +SKIP
>>> recorded.detections_at(recorded.row_of(12))  # doctest: +SKIP
>>> load_clip("clips/mobile").distance_m  # doctest: +SKIP
"""

from standoff.clips.clip import Clip, TrueBoard, TrueReference, load_clip, read_scene
from standoff.clips.clip_folder import (
    ANNOTATIONS_FILE,
    CAMERA_FILE,
    CLIP_FILES,
    CLIP_FORMAT,
    CLIP_FRAMES_FILE,
    CLIP_FRAMES_SCHEMA,
    DEVICES_FILE,
    DEVICES_SCHEMA,
    NOISY_DETECTIONS_FILE,
    NOISY_DETECTIONS_SCHEMA,
    PAIRS_FILE,
    PAIRS_SCHEMA,
    REFERENCE_FILE,
    RENDER_AGAIN,
    SCENE_FILE,
    TELEMETRY_FILE,
    TRUTH_FILE,
    TRUTH_FILES,
    TRUTH_NUMBERS,
    TRUTH_SCHEMA,
    VIDEO_FILE,
    read_clip_table,
)
from standoff.clips.columns import FRAME_COLUMNS, Column, Columns, chosen_rows, columns_of, read_columns, schema_of
from standoff.clips.detections import (
    COLUMNS,
    DETECTIONS_FILE,
    FOOT_COLUMNS,
    RecordedDetections,
    detections_of,
    is_recording,
    metadata_of,
    read_detections,
)
from standoff.clips.ground_maps import MAP_COLUMNS, map_of, map_values
from standoff.clips.looks import KeptLooks, part_path
from standoff.clips.run_folder import RunFolder, RunTable

__all__ = [
    "ANNOTATIONS_FILE",
    "CAMERA_FILE",
    "CLIP_FILES",
    "CLIP_FORMAT",
    "CLIP_FRAMES_FILE",
    "CLIP_FRAMES_SCHEMA",
    "COLUMNS",
    "DETECTIONS_FILE",
    "DEVICES_FILE",
    "DEVICES_SCHEMA",
    "FOOT_COLUMNS",
    "FRAME_COLUMNS",
    "MAP_COLUMNS",
    "NOISY_DETECTIONS_FILE",
    "NOISY_DETECTIONS_SCHEMA",
    "PAIRS_FILE",
    "PAIRS_SCHEMA",
    "REFERENCE_FILE",
    "RENDER_AGAIN",
    "SCENE_FILE",
    "TELEMETRY_FILE",
    "TRUTH_FILE",
    "TRUTH_FILES",
    "TRUTH_NUMBERS",
    "TRUTH_SCHEMA",
    "VIDEO_FILE",
    "Clip",
    "Column",
    "Columns",
    "KeptLooks",
    "RecordedDetections",
    "RunFolder",
    "RunTable",
    "TrueBoard",
    "TrueReference",
    "chosen_rows",
    "columns_of",
    "detections_of",
    "is_recording",
    "load_clip",
    "map_of",
    "map_values",
    "metadata_of",
    "part_path",
    "read_clip_table",
    "read_columns",
    "read_detections",
    "read_scene",
    "schema_of",
]
