"""Divide the photographs of vehicles: streets in which people are marked, too, and flights in which they are not.

    python label_people.py SHARED/aerial_vehicles people.yaml unlabelled.yaml DATA

writes DATA/streets and DATA/flights as YOLO sets of links to the photographs. `people.yaml` holds, by photograph, boxes
of people (proposed by a detector, then sorted by eye) and regions in which somebody may be, in pixels;
`unlabelled.yaml` what moves in the other photographs and has no label.
"""

from __future__ import annotations

import sys
from pathlib import Path

import cv2

from standoff.files.yaml_text import dump_yaml, read_yaml

NAMES = ("car", "truck", "bus", "minibus", "cyclist", "person")


def main() -> None:
    """Write both sets."""
    source, marks, moving, out = (Path(argument) for argument in sys.argv[1:])
    marked = read_yaml(marks, "marked people")
    for name in ("streets", "flights"):
        for kind in ("images", "labels"):
            (out / name / kind).mkdir(parents=True, exist_ok=True)
        (out / name / "classes.txt").write_text("\n".join(NAMES) + "\n")
    for picture in sorted((source / "images").iterdir()):
        people = marked.get(picture.stem)
        folder = out / ("flights" if people is None else "streets")
        link = folder / "images" / picture.name
        link.unlink(missing_ok=True)
        link.symlink_to(picture.resolve())
        rows = (source / "labels" / f"{picture.stem}.txt").read_text().splitlines()
        if people is not None:
            image = cv2.imread(str(picture))
            if image is None:
                sys.exit(f"cannot read {picture}")
            rows += [_row(box, image.shape[1], image.shape[0]) for box in people["people"]]
        (folder / "labels" / f"{picture.stem}.txt").write_text("\n".join(rows) + "\n")
    moves = read_yaml(moving, "boxes of what moves")
    unknown = {
        "streets": {stem: people["unknown"] for stem, people in marked.items()},
        "flights": {stem: boxes for stem, boxes in moves.items() if stem not in marked},
    }
    for name, regions in unknown.items():
        (out / name / "ignore.yaml").write_text(dump_yaml(regions))


def _row(box: list[float], width_px: int, height_px: int) -> str:
    left, top, right, bottom = box
    across, down = (left + right) / 2 / width_px, (top + bottom) / 2 / height_px
    sides = (across, down, (right - left) / width_px, (bottom - top) / height_px)
    return " ".join([str(NAMES.index("person")), *(f"{side:.6f}" for side in sides)])


if __name__ == "__main__":
    main()
