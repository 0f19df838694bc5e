"""What a run may write, by name: settings, help, clean-up and the sinks themselves go by this one table."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

SCHEMA_VERSION: Final = 1
"""Of the files of a run: one more where something in them goes or means something else, not where it is added."""

RECORD_FILE: Final = "run.json"
ASSISTANCE: Final = "Assistance only: no certified safety function, no replacement for a banksman or an exclusion zone"
"""Stands on whatever people read."""
ZONES_FILE: Final = "zones.geojson"
"""The zones of the site, in its frame, where there are any."""

LOOKS_FOLDER: Final = "looks.parts"
"""What the detector saw so far, while a run goes on and after one that was cut short; gone when a run is complete."""

OUTPUTS: Final[Mapping[str, str]] = MappingProxyType(
    {
        "tracks": "tracks.parquet",
        "proximity": "proximity.parquet",
        "frames": "frames.parquet",
        "detections": "detections.parquet",
        "hazards": "hazards.jsonl",
        "video": "annotated.mp4",
        "report": "report.html",
    }
)
"""The file of each output that can be left out."""

RUN_FILES: Final[tuple[str, ...]] = (RECORD_FILE, ZONES_FILE, *OUTPUTS.values())
"""Every file that a run can write, by its final name."""
