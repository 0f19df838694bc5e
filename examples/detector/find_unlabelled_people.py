"""Find what moves in aerial photographs of one place and is not labelled: mostly people.

In the photographs of a hovering drone only vehicles are labelled. Trained on as they are, they would teach a detector
that people are ground. What differs from the median of all photographs of a flight, after their alignment, and is no
labelled vehicle, becomes a region of which nothing is known.

    python find_unlabelled_people.py AERIAL_VEHICLES_FOLDER unlabelled.yaml
"""

from __future__ import annotations

import re
import sys
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from standoff.files.yaml_text import dump_yaml

Picture = npt.NDArray[np.uint8]
Matrix = npt.NDArray[np.float64]

_FLIGHT = re.compile(r"(DJI[-_]\d+)-\d+$")
_STILL = re.compile(r"DJI_\d+$")
"""A single photograph: there is no saying what moves, so that nothing is known of all of it."""
_LEAST_PICTURES = 4
"""For a median that shows the ground and not the traffic."""
_CORNERS = 4000
_OUTLIER_PX = 2.0
_DIFFERENT = 28
"""Grey levels, the most of three channels, after shifting by up to a pixel."""
_SIDES_PX = 5, 45
_LEAST_AREA_PX = 12
_ROOM_PX = 4.0
_VEHICLE_ROOM_PX = 12.0
_CYCLIST = 4


def find_regions(folder: Path) -> dict[str, list[list[float]]]:
    """Return regions (left, top, right, bottom; px) by picture stem."""
    flights: dict[str, list[Path]] = defaultdict(list)
    regions: dict[str, list[list[float]]] = {}
    for path in sorted((folder / "images").iterdir()):
        match = _FLIGHT.match(path.stem)
        if match:
            flights[match.group(1)].append(path)
        elif _STILL.match(path.stem):
            height, width = _read(path).shape[:2]
            regions[path.stem] = [[0.0, 0.0, float(width), float(height)]]
    for paths in flights.values():
        if len(paths) >= _LEAST_PICTURES:
            regions |= _find_in_flight(paths, folder / "labels")
    return regions


def _find_in_flight(paths: Sequence[Path], labels: Path) -> dict[str, list[list[float]]]:
    pictures = [_read(path) for path in paths]
    to_middle = _align(pictures)
    height, width = pictures[0].shape[:2]
    aligned = [
        cv2.warpPerspective(picture, matrix, (width, height), borderMode=cv2.BORDER_REPLICATE)
        for picture, matrix in zip(pictures, to_middle, strict=True)
    ]
    ground = np.median(np.stack(aligned), axis=0).astype(np.uint8)
    regions = {}
    for path, picture, matrix in zip(paths, pictures, to_middle, strict=True):
        back = np.asarray(np.linalg.inv(matrix), dtype=np.float64)
        empty = cv2.warpPerspective(ground, back, (width, height), borderMode=cv2.BORDER_REPLICATE)
        vehicles = _read_vehicles(labels / f"{path.stem}.txt", width, height)
        regions[path.stem] = _moving(picture, np.asarray(empty, dtype=np.uint8), vehicles)
    return regions


def _read(path: Path) -> Picture:
    picture = cv2.imread(str(path))
    if picture is None:
        sys.exit(f"expected a picture, found {path}. Check the folder.")
    return np.asarray(picture, dtype=np.uint8)


def _align(pictures: Sequence[Picture]) -> list[Matrix]:
    """Return the homography of each picture to the middle one."""
    finder = cv2.ORB.create(_CORNERS)
    found = [finder.detectAndCompute(cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY), None) for picture in pictures]
    middle_points, middle_words = found[len(found) // 2]
    matrices = []
    for points, words in found:
        matches = cv2.BFMatcher(cv2.NORM_HAMMING, crossCheck=True).match(words, middle_words)
        source = np.array([points[match.queryIdx].pt for match in matches])
        target = np.array([middle_points[match.trainIdx].pt for match in matches])
        matrix, _ = cv2.findHomography(source, target, cv2.RANSAC, _OUTLIER_PX)
        matrices.append(np.asarray(matrix, dtype=np.float64))
    return matrices


def _read_vehicles(path: Path, width: int, height: int) -> Matrix:
    rows = np.array([line.split()[:5] for line in path.read_text().splitlines()], dtype=np.float64).reshape(-1, 5)
    rows = rows[rows[:, 0] != _CYCLIST]
    centre, half = rows[:, 1:3] * [width, height], rows[:, 3:5] * [width, height] / 2.0
    return np.hstack([centre - half, centre + half])


def _moving(picture: Picture, empty: Picture, vehicles: Matrix) -> list[list[float]]:
    height, width = picture.shape[:2]
    difference = np.full((height, width), 255, np.uint8)
    for shift_y in (-1.0, 0.0, 1.0):
        for shift_x in (-1.0, 0.0, 1.0):
            shift = np.array([[1.0, 0.0, shift_x], [0.0, 1.0, shift_y]])
            moved = cv2.warpAffine(empty, shift, (width, height), borderMode=cv2.BORDER_REPLICATE)
            difference = np.minimum(difference, cv2.absdiff(moved, picture).max(axis=2))
    mask = cv2.morphologyEx((difference > _DIFFERENT).astype(np.uint8), cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8))
    _, _, blobs, _ = cv2.connectedComponentsWithStats(mask)
    regions = []
    for left, top, wide, high, area in blobs[1:].tolist():
        small = _SIDES_PX[0] <= max(wide, high) <= _SIDES_PX[1] and area >= _LEAST_AREA_PX
        x, y = left + wide / 2.0, top + high / 2.0
        near = (vehicles[:, :2] - _VEHICLE_ROOM_PX < [x, y]) & ([x, y] < vehicles[:, 2:] + _VEHICLE_ROOM_PX)
        if small and not near.all(axis=1).any():
            regions.append(
                [max(0.0, left - _ROOM_PX), max(0.0, top - _ROOM_PX), left + wide + _ROOM_PX, top + high + _ROOM_PX]
            )
    return regions


if __name__ == "__main__":
    Path(sys.argv[2]).write_text(dump_yaml(find_regions(Path(sys.argv[1])), flow=None))
