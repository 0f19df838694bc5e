"""How small a printed marker is still found, and how far off its corners are: one table, from drawn films."""

from __future__ import annotations

import argparse

import numpy as np

from standoff.evaluation.drawn_markers import HARDSHIPS, Hardship, marker_film
from standoff.stages.ground import MARKER_FAMILIES, MarkerFamily, find_markers, marker_pattern

SIDES_PX = (12.0, 14.0, 16.0, 18.0, 20.0, 22.0, 25.0, 30.0, 40.0, 60.0)
MARKERS = 25
WRONG_PX = 3.0


def measure(
    family: MarkerFamily, side_px: float, hardship: Hardship, films: int
) -> tuple[float, float, float, float, int]:
    """Return the share found, the corners' error and stated error (px), the share of errors below two, false reads."""
    errors, sigmas, found, false = [], [], 0, 0
    for seed in range(films):
        patterns = [marker_pattern(family, one) for one in range(MARKERS)]
        picture, truth = marker_film(patterns, side_px, hardship, np.random.default_rng(1000 * seed + int(side_px)))
        markers = find_markers(picture, family)
        for marker_id, corners, sigma in zip(markers.ids.tolist(), markers.corners_px, markers.sigma_px, strict=True):
            if marker_id >= MARKERS or np.abs(corners - truth[marker_id]).max() > WRONG_PX:
                false += 1
                continue
            found += 1
            errors.append(corners - truth[marker_id])
            sigmas.append(sigma)
    if not errors:
        return 0.0, float("nan"), float("nan"), float("nan"), false
    error, sigma = np.array(errors), np.array(sigmas)
    within = float((np.abs(error) < 2.0 * sigma[..., None]).mean())
    rms = float(np.sqrt((error**2).mean()))
    return found / (films * MARKERS), rms, float(np.sqrt((sigma**2).mean())), within, false


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--family", choices=MARKER_FAMILIES, default="apriltag36h11")
    parser.add_argument("--films", type=int, default=4)
    asked = parser.parse_args()
    print("| side px | " + " | ".join(hardship.name for hardship in HARDSHIPS) + " |")
    print("|---|" + "---|" * len(HARDSHIPS))
    false = 0
    for side_px in SIDES_PX:
        cells = []
        for hardship in HARDSHIPS:
            share, rms, sigma, within, wrong = measure(asked.family, side_px, hardship, asked.films)
            false += wrong
            cells.append(f"{100 * share:.0f} %, {rms:.2f} ({sigma:.2f}; {100 * within:.0f} %)")
        print(f"| {side_px:g} | " + " | ".join(cells) + " |", flush=True)
    print(f"false reads: {false}")


if __name__ == "__main__":
    main()
