"""Make data sets of real photographs of sites: what may be learnt from, what to choose by, and what to report.

    python take_photographs.py SHARED/site_photographs real_points.yaml DATA

writes DATA/photographs (all for training), DATA/photographs_choose and DATA/photographs_report, the two halves of what
is held out, as YOLO sets of links. No site is in two of them: the pictures of a source are numbered by site, and the
halves are cut between numbers. One source was squeezed to squares when it was published, so that people look thin: its
training pictures are stretched by a factor of their own, 1 to 1.8. `real_points.yaml` holds ground points that somebody
marked in the held-out ones.
"""

from __future__ import annotations

import sys
import zlib
from pathlib import Path

import cv2
import numpy as np

from standoff.files.yaml_text import dump_yaml, read_yaml

SQUEEZED = "rf100"
MOST_STRETCH = 1.8
SAME_PX = 1.0
"""A box of the labels that differs by no more from a marked one is that."""


def main() -> None:
    """Write the three sets."""
    source, points, out = (Path(argument) for argument in sys.argv[1:])
    marked = read_yaml(points, "marked points")
    regions: dict[str, dict[str, list[list[float]]]] = {}
    for folder in sorted(path for path in source.iterdir() if path.is_dir()):
        ignored = read_yaml(folder / "ignore.yaml", "regions to ignore") or {}
        held_out = sorted(_listed(folder / "val.txt"))
        parts = {
            "photographs": sorted(_listed(folder / "train.txt")),
            "photographs_choose": held_out[: len(held_out) // 2],
            "photographs_report": held_out[len(held_out) // 2 :],
        }
        for name, pictures in parts.items():
            for picture in pictures:
                factor = _stretch(picture) if (folder.name, name) == (SQUEEZED, "photographs") else 1.0
                stem = f"{folder.name}-{picture.stem}"
                _take(folder / picture, out / name, stem, factor)
                if stem in marked:
                    _mark(out / name, stem, marked[stem], factor)
                boxes = ignored.get(picture.stem) or []
                regions.setdefault(name, {})[stem] = [[x1 * factor, y1, x2 * factor, y2] for x1, y1, x2, y2 in boxes]
        names = (folder / "classes.txt").read_text()
        for name in parts:
            (out / name / "classes.txt").write_text(names)
    for name, boxes in regions.items():
        (out / name / "ignore.yaml").write_text(dump_yaml(boxes))


def _listed(file: Path) -> list[Path]:
    return [Path(line) for line in file.read_text().split()]


def _stretch(picture: Path) -> float:
    return 1.0 + (MOST_STRETCH - 1.0) * (zlib.crc32(picture.stem.encode()) % 1000) / 1000.0


def _take(picture: Path, out: Path, stem: str, factor: float) -> None:
    """Link a picture and its labels, or stretch it: YOLO's shares stay what they are."""
    for kind in ("images", "labels"):
        (out / kind).mkdir(parents=True, exist_ok=True)
    labels = picture.parent.parent / "labels" / f"{picture.stem}.txt"
    (out / "labels" / f"{stem}.txt").write_text(labels.read_text())
    target = out / "images" / f"{stem}{picture.suffix}"
    target.unlink(missing_ok=True)
    if factor == 1.0:
        target.symlink_to(picture.resolve())
        return
    image = cv2.imread(str(picture))
    if image is None:
        sys.exit(f"cannot read {picture}")
    size_px = round(image.shape[1] * factor), image.shape[0]
    cv2.imwrite(str(target), cv2.resize(image, size_px, interpolation=cv2.INTER_LINEAR))


def _mark(out: Path, stem: str, marks: list[list[float]], factor: float) -> None:
    """Write the point of each labelled box that was marked, for the others that none was."""
    image = cv2.imread(str(next((out / "images").glob(f"{stem}.*"))))
    if image is None:
        sys.exit(f"cannot read the picture of {stem}")
    size_px = np.array([image.shape[1], image.shape[0]])
    by_box = np.array(marks) * [factor, 1, factor, 1, factor, 1]
    lines = []
    for label in (out / "labels" / f"{stem}.txt").read_text().splitlines():
        share = np.array(label.split()[1:5], dtype=np.float64)
        centre_px, half_px = share[:2] * size_px - 0.5, share[2:] * size_px / 2
        off_px = np.abs(by_box[:, :4] - np.concatenate([centre_px - half_px, centre_px + half_px])).max(axis=1)
        point = (by_box[off_px.argmin(), 4:] + 0.5) / size_px if off_px.min() < SAME_PX else [np.nan, np.nan]
        lines.append(f"{point[0]:.6f} {point[1]:.6f}\n")
    (out / "points").mkdir(exist_ok=True)
    (out / "points" / f"{stem}.txt").write_text("".join(lines))


if __name__ == "__main__":
    main()
