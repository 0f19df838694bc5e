"""Where the pictures of a data set were taken from: metres of what is marked in them.

`views.jsonl` in a set's folder has a line a picture: its file's name, the camera's matrix and distortion, where the
camera is and how it is turned, and the height of the ground under what is marked.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from standoff.core.camera import Camera, Lens
from standoff.core.errors import DataError
from standoff.core.homography import FloatArray
from standoff.core.pose import View
from standoff.files.json_text import parse_json
from standoff.files.plain_text import read_text

VIEWS_FILE: Final = "views.jsonl"


@dataclass(frozen=True, slots=True, eq=False)
class GroundView:
    """How a picture shows the ground.

    Attributes:
        view: Camera and place, site frame.
        ground_m: Height of the ground where it matters, site frame.
    """

    view: View
    ground_m: float

    def to_ground(self, points_px: FloatArray) -> FloatArray:
        """Return (N, 2) site coordinates in metres of (N, 2) picture points; NaN beyond the horizon."""
        return self.view.to_plane(points_px, self.ground_m)


def view_line(picture: str, seen: GroundView) -> str:
    """Return the line of a picture, named as its file is."""
    camera = seen.view.camera
    entry = {
        "picture": picture,
        "size_px": [camera.width_px, camera.height_px],
        "camera_matrix": camera.matrix.tolist(),
        "distortion": camera.distortion.tolist(),
        "lens": camera.lens,
        "position_m": seen.view.position_m.tolist(),
        "site_to_camera": seen.view.site_to_camera.tolist(),
        "ground_m": seen.ground_m,
    }
    return json.dumps(entry) + "\n"


def read_views(path: Path) -> dict[str, GroundView]:
    """Read the views of a set's pictures, by the names of their files.

    Raises:
        DataError: A line is something else.
    """
    views = {}
    for number, line in enumerate(read_text(path, "the views of a set").splitlines(), start=1):
        entry = parse_json(line, "a camera", f"line {number} of {path}")
        try:
            views[str(entry["picture"])] = _ground_view(entry)
        except (KeyError, TypeError, ValueError) as error:
            raise DataError(
                expected=f"a camera in line {number} of {path}",
                found=f"{type(error).__name__}: {error}",
                fix="write the data set again with `standoff simulate`, or remove the file",
            ) from error
    return views


def views_of(pictures: Sequence[Path]) -> dict[int, GroundView]:
    """Return how pictures show the ground, by their position, where the sets that they belong to tell.

    Args:
        pictures: Files, in `images` of their sets.

    Raises:
        DataError: A set's file of views is damaged.
    """
    read: dict[Path, dict[str, GroundView]] = {}
    found = {}
    for position, path in enumerate(pictures):
        images = next((parent for parent in path.parents if parent.name == "images"), None)
        if images is None:
            continue
        file = images.parent / VIEWS_FILE
        if file not in read:
            read[file] = read_views(file) if file.is_file() else {}
        if path.name in read[file]:
            found[position] = read[file][path.name]
    return found


def _ground_view(entry: dict[str, Any]) -> GroundView:
    width_px, height_px = (int(side) for side in entry["size_px"])
    lens: Lens = entry.get("lens", "brown")
    camera = Camera(width_px, height_px, np.array(entry["camera_matrix"]), np.array(entry["distortion"]), lens)
    view = View(camera, np.array(entry["position_m"]), np.array(entry["site_to_camera"]))
    return GroundView(view, float(entry["ground_m"]))
