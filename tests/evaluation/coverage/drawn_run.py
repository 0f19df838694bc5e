"""A clip's truth and a run of it as tables alone: people and machines that walk about, boxes far apart."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import yaml

from standoff.core.homography import FloatArray

FRAMES = 40
FPS = 10.0
SIZE_PX = (1280, 720)
CLASSES = {1: (0, "worker"), 2: (0, "worker"), 3: (1, "excavator"), 4: (2, "wheel_loader")}
REFERENCE_ID = 1000
SQUARE_M = np.array([[0.0, 0.0], [3.0, 0.0], [3.0, 3.0], [0.0, 3.0]])
TRACK_OF = {entity: entity + 100 for entity in CLASSES}


@dataclass
class Drawn:
    """Rows of the tables, to be changed before they are written."""

    truth: list[dict[str, Any]]
    pairs: list[dict[str, Any]]
    frames: list[dict[str, Any]]
    tracks: list[dict[str, Any]]
    proximity: list[dict[str, Any]]
    record: dict[str, Any] = field(
        default_factory=lambda: {
            "source": {},
            "settings": {"ground": {"reference": {"corners_m": SQUARE_M.tolist()}}},
        }
    )

    def write(self, folder: Path) -> tuple[Path, Path]:
        """Return the folders of the run and of the clip."""
        run, clip = folder / "run", folder / "clip"
        tables = {
            run: {"tracks": self.tracks, "proximity": self.proximity, "frames": self.frames},
            clip: {"truth": self.truth, "pairs": self.pairs},
        }
        for place, of_place in tables.items():
            place.mkdir(parents=True)
            for name, rows in of_place.items():
                pq.write_table(pa.Table.from_pylist(rows), place / f"{name}.parquet")
        (run / "run.json").write_text(json.dumps(self.record))
        camera = {"width_px": SIZE_PX[0], "height_px": SIZE_PX[1], "fx": 1000.0, "fy": 1000.0, "cx": 640.0, "cy": 360.0}
        (clip / "camera.yaml").write_text(yaml.safe_dump(camera))
        top_m = np.column_stack([SQUARE_M, np.zeros(4)]).tolist()
        scene = {"format": 1, "preset": "drawn", "seed": 0, "entities": [], "board": None}
        scene["reference"] = {"entity_id": REFERENCE_ID, "top_m": top_m, "base_m": top_m}
        (clip / "scene.json").write_text(json.dumps(scene))
        return run, clip


def draw(seed: int = 0, *, sigma_m: float = 0.3, stated_m: float | None = None, frames: int = FRAMES) -> Drawn:
    """Draw a run whose distances are off by errors of a standard error, and its coordinates, too.

    Args:
        seed: Of the places and the errors.
        sigma_m: Of the errors.
        stated_m: What the run states; left out: the truth.
        frames: How many.
    """
    rng = np.random.default_rng(seed)
    stated_m = sigma_m if stated_m is None else stated_m
    drawn = Drawn([], [], [], [], [])
    for frame in range(frames):
        at = {"frame": frame, "time_s": frame / FPS}
        drawn.frames.append({**at, "map_method": "fused"})
        xy_m = {entity: rng.uniform(-20.0, 20.0, 2) for entity in CLASSES}
        for place, entity in enumerate(CLASSES):
            _draw_entity(drawn, at, entity, 100.0 + 250.0 * place, xy_m[entity], rng.normal(0.0, sigma_m, 2), stated_m)
        drawn.truth.append({**at, **_truth_row(REFERENCE_ID, 6, 20.0, np.array([1.5, 1.5]))})
        for first in CLASSES:
            for second in CLASSES:
                if first < second:
                    true_m = float(np.linalg.norm(xy_m[first] - xy_m[second]))
                    drawn.pairs.append({**at, "entity_a": first, "entity_b": second, "centre_m": true_m})
                    _draw_distance(drawn, at, (first, second), true_m + rng.normal(0.0, sigma_m), stated_m)
    return drawn


def _draw_entity(
    drawn: Drawn, at: dict[str, Any], entity: int, left_px: float, xy_m: FloatArray, off_m: FloatArray, stated_m: float
) -> None:
    class_id, class_name = CLASSES[entity]
    row = _truth_row(entity, class_id, left_px, xy_m)
    drawn.truth.append({**at, **row})
    box = {name: row[name] for name in ("x1_px", "y1_px", "x2_px", "y2_px")}
    place = dict(zip(("x_m", "y_m"), (xy_m + off_m).tolist(), strict=True))
    sigma = {"sigma_x_m": stated_m, "sigma_y_m": stated_m, "cov_xy_m2": 0.0}
    drawn.tracks.append(
        {**at, "track_id": TRACK_OF[entity], "class": class_name, "observed": True, **box, **place, **sigma}
    )


def _truth_row(entity: int, class_id: int, left_px: float, xy_m: FloatArray) -> dict[str, Any]:
    box = {"x1_px": left_px, "y1_px": 300.0, "x2_px": left_px + 100.0, "y2_px": 400.0}
    place = dict(zip(("x_m", "y_m"), xy_m.tolist(), strict=True))
    full = {f"full_{name}": value for name, value in box.items()}
    return {"entity_id": entity, "class_id": class_id, "visible_share": 1.0, **place, **box, **full}


def _draw_distance(drawn: Drawn, at: dict[str, Any], ends: tuple[int, int], measured_m: float, stated_m: float) -> None:
    if CLASSES[ends[0]][0] == 0 != CLASSES[ends[1]][0]:
        ids = {"track_a": TRACK_OF[ends[0]], "track_b": TRACK_OF[ends[1]]}
        drawn.proximity.append({**at, **ids, "distance_m": measured_m, "sigma_m": stated_m, "measured": True})
