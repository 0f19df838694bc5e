"""People who stand still: their truth, tracks of them, and both as files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet
from scipy.spatial.distance import pdist

from standoff.clips import Columns
from standoff.core.homography import FloatArray

FRAMES = 6
STANDING_M = np.array([[0.0, 0.0], [3.0, 0.0], [3.0, 4.0], [40.0, 0.0]])
HEADER = "frame,id,x,y,w,h,conf,X,Y,Z"


def make_truth(standing_m: FloatArray = STANDING_M, frames: int = FRAMES) -> Columns:
    """Truth of people who stand still, 100 px apart in the picture."""
    people = len(standing_m)
    person = np.tile(np.arange(people), frames)
    return {
        "frame": np.repeat(np.arange(1.0, frames + 1), people),
        "id": person + 1.0,
        "x": 100.0 * person,
        "y": np.full(len(person), 50.0),
        "w": np.full(len(person), 30.0),
        "h": np.full(len(person), 75.0),
        "conf": np.ones(len(person)),
        "X": standing_m[person, 0],
        "Y": standing_m[person, 1],
    }


def make_tracks(truth: Columns, error_m: FloatArray | None = None) -> dict[str, Any]:
    """Tracks exactly where the truth is, or off by (N, 2) metres; ids are the truth's plus 10."""
    error_m = np.zeros((len(truth["frame"]), 2)) if error_m is None else error_m
    return {
        "frame": truth["frame"].astype(np.int64) - 1,
        "track_id": truth["id"].astype(np.int64) + 10,
        "class": np.full(len(truth["frame"]), "worker", dtype=object),
        "x1_px": truth["x"],
        "y1_px": truth["y"],
        "x2_px": truth["x"] + truth["w"],
        "y2_px": truth["y"] + truth["h"],
        "observed": np.ones(len(truth["frame"]), dtype=np.bool_),
        "x_m": truth["X"] + error_m[:, 0],
        "y_m": truth["Y"] + error_m[:, 1],
    }


def make_pairs(tracks: Columns, sigma_m: float = 0.1) -> dict[str, Any]:
    """Measure all pairs of tracks from their positions."""
    rows: list[tuple[int, int, int, float]] = []
    for frame in np.unique(tracks["frame"]):
        here = np.flatnonzero(tracks["frame"] == frame)
        distance_m = pdist(np.column_stack([tracks["x_m"], tracks["y_m"]])[here])
        first, second = np.triu_indices(len(here), k=1)
        ids = tracks["track_id"][here]
        rows += zip([int(frame)] * len(first), ids[first], ids[second], distance_m, strict=True)
    frames, first_id, second_id, distances = np.array(rows).T
    return {
        "frame": frames.astype(np.int64),
        "track_a": first_id.astype(np.int64),
        "track_b": second_id.astype(np.int64),
        "distance_m": distances,
        "sigma_m": np.full(len(rows), sigma_m),
        "measured": np.ones(len(rows), dtype=np.bool_),
    }


def write_run(folder: Path, tracks: dict[str, Any], pairs: dict[str, Any]) -> None:
    names = pa.array(tracks["class"]).dictionary_encode()
    pa.parquet.write_table(pa.table({**tracks, "class": names}), folder / "tracks.parquet")
    pa.parquet.write_table(pa.table(pairs), folder / "proximity.parquet")


def write_truth(path: Path, truth: Columns) -> Path:
    names = HEADER.split(",")[:-1]
    rows = zip(*(truth[name].tolist() for name in names), strict=True)
    path.write_text("\n".join([HEADER, *(",".join(map(str, row)) + ",0" for row in rows)]) + "\n")
    return path
