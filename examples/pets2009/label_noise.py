"""Estimate how much of an error of distances is the truth's own: what jumps in it from frame to frame.

    python label_noise.py gt.csv

People walk evenly over three frames, so the second difference of a pair's true distance is noise: sqrt(6) times that of
one frame. What a label errs all the time, because its box is drawn too low, is not in it.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from standoff.core.homography import FloatArray
from standoff.evaluation.positions_input import read_truth

FRAMES = (1, 219)
UP_TO_M = 15.0


def distances_m(truth_file: Path) -> FloatArray:
    """Return (frames, pairs) true distances up to `UP_TO_M`; NaN where one of the two has no label."""
    truth = read_truth(truth_file)
    first, last = FRAMES
    scored = (truth["conf"] > 0) & (truth["frame"] >= first) & (truth["frame"] <= last)
    ids, person = np.unique(truth["id"][scored], return_inverse=True)
    xy_m = np.full((last - first + 1, len(ids), 2), np.nan)
    xy_m[truth["frame"][scored].astype(int) - first, person] = np.column_stack([truth["X"], truth["Y"]])[scored]
    one, other = np.triu_indices(len(ids), k=1)
    apart_m = np.linalg.norm(xy_m[:, one] - xy_m[:, other], axis=2)
    return np.where(apart_m <= UP_TO_M, apart_m, np.nan)


def main() -> None:
    """Print the estimate."""
    jumps_m = np.diff(distances_m(Path(sys.argv[1])), n=2, axis=0)
    jumps_m = jumps_m[np.isfinite(jumps_m)]
    sigma_m = float(np.sqrt((jumps_m**2).mean() / 6.0))
    mean_m = float(np.abs(jumps_m).mean() / np.sqrt(6.0))
    print(f"{len(jumps_m)} triples of frames: a true distance jumps by {mean_m:.3f} m (standard error {sigma_m:.3f} m)")


if __name__ == "__main__":
    main()
