"""Make data sets of real photographs of sites: what may be learnt from, what to choose by, and what to report.

    python take_photographs.py SHARED/site_photographs DATA

writes DATA/photographs (all for training), DATA/photographs_choose and DATA/photographs_report, the two halves of what
is held out, as YOLO sets of links. No site is in two of them: the pictures of a source are numbered by site, and the
halves are cut between numbers. One source was squeezed to squares when it was published, so that people look thin: its
training pictures are stretched by a factor of their own, 1 to 1.8.
"""

from __future__ import annotations

import sys
import zlib
from pathlib import Path

import cv2
import yaml

SQUEEZED = "rf100"
MOST_STRETCH = 1.8


def main() -> None:
    """Write the three sets."""
    source, out = (Path(argument) for argument in sys.argv[1:])
    regions: dict[str, dict[str, list[list[float]]]] = {}
    for folder in sorted(path for path in source.iterdir() if path.is_dir()):
        ignored = yaml.safe_load((folder / "ignore.yaml").read_text()) or {}
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
                boxes = ignored.get(picture.stem) or []
                regions.setdefault(name, {})[stem] = [[x1 * factor, y1, x2 * factor, y2] for x1, y1, x2, y2 in boxes]
        names = (folder / "classes.txt").read_text()
        for name in parts:
            (out / name / "classes.txt").write_text(names)
    for name, boxes in regions.items():
        (out / name / "ignore.yaml").write_text(yaml.safe_dump(boxes))


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


if __name__ == "__main__":
    main()
