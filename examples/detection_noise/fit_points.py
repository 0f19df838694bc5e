"""Fit the ground points of `standoff_sim.clip.detection_noise` to those that runs of rendered clips recorded.

    python examples/detection_noise/fit_points.py RUN CLIP [RUN CLIP ...]

Prints a table as the module holds it, and on how many points and entities each row of it rests. Runs need `detections`
among their outputs.
"""

from __future__ import annotations

import argparse
from collections import defaultdict
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
from fit import LEAST_PX, SIDES, match

from standoff.clips import TRUTH_FILE, read_detections
from standoff.core.classes import CLASSES
from standoff.core.homography import FloatArray
from standoff_sim.clip.detection_noise import PointNoise

LEAST_SCORE = 0.3
"""What is less sure starts no track."""
LASTS_S = (0.2, 0.6, 1.0, 2.0, 3.0)
_NORMAL_68 = 0.9945
"""Standard errors within which 68 % of normal errors lie."""
Points = dict[str, dict[tuple[str, int], list[FloatArray]]]


def collect(run: Path, clip: Path, points: Points) -> None:
    """Add the ground points of a run: (5,) time, error right and down and standard errors, in longer sides."""
    recorded = read_detections(run)
    truths = defaultdict(list)
    for row in pq.read_table(clip / TRUTH_FILE).to_pylist():
        if row["visible_px"] >= LEAST_PX:
            truths[row["frame"]].append(row)
    for at, frame in enumerate(recorded.frame.tolist()):
        found = recorded.detections_at(at)
        found = found[found.score >= LEAST_SCORE]
        boxes_px = np.array([[row[side] for side in SIDES] for row in truths[frame]]).reshape(-1, 4)
        classes = np.array([row["class_id"] for row in truths[frame]], dtype=np.int64)
        for number, find in match(boxes_px, classes, found.xyxy_px, found.class_id).items():
            foot_px, row = found.foot_px[find], truths[frame][number]
            if np.isfinite(foot_px).all():
                longer_px = float((found.xyxy_px[find, 2:] - found.xyxy_px[find, :2]).max())
                off_px = foot_px - (row["foot_x_px"], row["foot_y_px"])
                sigma_px = np.sqrt(np.diagonal(found.foot_covariance_px2[find]))
                told = np.array([recorded.time_s[at], *(off_px / longer_px), *(sigma_px / longer_px)])
                points[row["class_name"]][clip.name, row["entity_id"]].append(told)


def summarised(entities: list[FloatArray]) -> PointNoise:
    """Return the row of one class."""
    told = np.concatenate(entities)
    off, logs = told[:, 1:3], np.log(told[:, 3:])
    stated = np.median(logs, axis=0)
    bias = np.median(off, axis=0)
    ratio = (off - bias) / np.exp(logs)
    spread = np.std(np.array([np.median(np.log(one[:, 3:]) - stated) for one in entities]))
    deviation = np.quantile(np.abs(ratio), 0.68, axis=0) / _NORMAL_68
    rounded = [tuple(np.round(part, 3).tolist()) for part in (np.exp(stated), bias, deviation)]
    return PointNoise(rounded[0], round(float(spread), 2), rounded[1], rounded[2])


def lasting_shares(entities: list[FloatArray], bias: FloatArray) -> str:
    """Say how much of the variance of one entity's errors is the same after so many seconds."""
    products = defaultdict(list)
    for entity in entities:
        errors = np.clip((entity[:, 1:3] - bias) / entity[:, 3:], -3.0, 3.0)
        for row, (time_s, error) in enumerate(zip(entity[:, 0], errors, strict=True)):
            for later_s, later in zip(entity[row:, 0] - time_s, errors[row:], strict=True):
                products[round(float(later_s), 1)].append(float(error @ later))
    whole = np.mean(products[0.0])
    shares = {after_s: np.mean(products[after_s]) / whole for after_s in LASTS_S if after_s in products}
    return ", ".join(f"{share:.2f} after {after_s} s" for after_s, share in shares.items())


def main() -> None:
    """Fit and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folders", nargs="+", type=Path, help="RUN CLIP ...")
    folders = parser.parse_args().folders
    points: Points = defaultdict(lambda: defaultdict(list))
    for run, clip in zip(folders[::2], folders[1::2], strict=True):
        collect(run, clip, points)
    for name in (one.name for one in CLASSES if one.name in points):
        entities = [np.array(told) for told in points[name].values()]
        row = summarised(entities)
        print(f"# {sum(map(len, entities))} points of {len(entities)} entities; the same of their errors: ", end="")
        print(lasting_shares(entities, np.array(row.bias)))
        print(f'"{name}": {row},')


if __name__ == "__main__":
    main()
