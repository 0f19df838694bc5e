"""Choose eight surveyed points for the PETS 2009 picture from its truth file and write survey.yaml.

    python choose_survey_points.py gt.csv survey.yaml

Every point is the foot of one labelled person (bottom centre of the box, floored as the labels' own metres were)
in frames 388-554; frames 1-219 stay unseen, because the run is scored on them. The eight are the ones that pin the
homography down best while they keep a distance from each other, which evens out what a homography cannot follow
(the lens): one after another, the foot that raises the determinant of the fit's information most (greedy D-optimal
design), then single exchanges until none helps.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from standoff.core import homography
from standoff.core.homography import FloatArray
from standoff.core.types import IntArray

FRAMES = (388, 554)
IMAGE_SIZE_PX = (768, 576)
POINTS = 8
APART_PX = 180.0
_HEADER = """\
# Eight points of the PETS 2009 S2.L1 view 1 picture with their metres on the ground.
# Chosen by choose_survey_points.py: feet of labelled people in frames {first}-{last}, the eight that together pin the
# homography down best (D-optimal). Frames 1-219, on which the run is scored, were not looked at.
# Fit over the other {others} feet of these frames: median {median:.3f} m, 95 % within {p95:.3f} m, worst {worst:.3f} m.
"""


def read_feet(truth_file: Path) -> tuple[FloatArray, FloatArray, IntArray]:
    """Return feet (N, 2) in pixels, their positions (N, 2) in metres, and frame and id (N, 2)."""
    rows = np.genfromtxt(truth_file, delimiter=",", names=True)
    width_px, height_px = IMAGE_SIZE_PX
    whole = (rows["x"] >= 0) & (rows["x"] + rows["w"] < width_px) & (rows["y"] + rows["h"] < height_px)
    rows = rows[(rows["frame"] >= FRAMES[0]) & (rows["frame"] <= FRAMES[1]) & (rows["conf"] > 0) & whole]
    feet_px = np.floor(np.column_stack([rows["x"] + rows["w"] / 2, rows["y"] + rows["h"]]))
    return feet_px, np.column_stack([rows["X"], rows["Y"]]), np.column_stack([rows["frame"], rows["id"]]).astype(int)


def choose(feet_px: FloatArray, feet_m: FloatArray, count: int) -> IntArray:
    """Return the indices of the `count` points with the most information on the homography between them."""
    ground_to_image = homography.invert(homography.fit(feet_px, feet_m))
    sensitivity = homography.parameter_jacobian(ground_to_image, feet_m)
    scale = np.abs(sensitivity).max(axis=(0, 1))
    # The common scale of all nine entries moves no point; the other eight directions remain.
    free = np.linalg.svd((ground_to_image.ravel() * scale)[None])[2][1:].T
    design = (sensitivity / scale) @ free
    information = design.transpose(0, 2, 1) @ design

    def best_with(others: list[int]) -> int:
        gain = np.linalg.slogdet(information[others].sum(axis=0) + 1e-9 * np.eye(8) + information)[1]
        too_close = np.linalg.norm(feet_px[:, None] - feet_px[others], axis=2) < APART_PX
        return int(np.where(too_close.any(axis=1), -np.inf, gain).argmax())

    chosen: list[int] = []
    for _ in range(count):
        chosen.append(best_with(chosen))
    while True:
        before = list(chosen)
        for place in range(count):
            chosen[place] = best_with(chosen[:place] + chosen[place + 1 :])
        if chosen == before:
            return np.array(chosen)


def main(truth_file: Path, survey_file: Path) -> None:
    """Choose the points, say how well their homography fits the other feet, and write them down."""
    feet_px, feet_m, labels = read_feet(truth_file)
    chosen = choose(feet_px, feet_m, POINTS)
    chosen = chosen[np.lexsort(feet_px[chosen].T)]
    others = np.setdiff1d(np.arange(len(feet_px)), chosen)
    mapped_m, _ = homography.apply(homography.fit(feet_px[chosen], feet_m[chosen]), feet_px[others])
    error_m = np.linalg.norm(mapped_m - feet_m[others], axis=1)
    median, p95 = np.percentile(error_m, [50, 95])
    lines = [
        _HEADER.format(
            first=FRAMES[0], last=FRAMES[1], others=len(others), median=median, p95=p95, worst=error_m.max()
        ),
        f"image_size_px: [{IMAGE_SIZE_PX[0]}, {IMAGE_SIZE_PX[1]}]\npoints:\n",
    ]
    for (x, y), (east, north), (frame, person) in zip(feet_px[chosen], feet_m[chosen], labels[chosen], strict=True):
        lines.append(f"  - {{name: frame {frame} id {person}, px: [{x:g}, {y:g}], m: [{east:g}, {north:g}]}}\n")
    survey_file.write_text("".join(lines))
    print("".join(lines))


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
