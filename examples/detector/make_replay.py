"""Makes the rendered pictures that the preset `my-site` shows in between: one each of many scenes, smaller.

python examples/detector/make_replay.py DATA/sim-0 DATA/sim-1 ... OUT
"""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

import cv2

TRAIN, VAL = 24, 8
SIZE_PX = (960, 540)
QUALITY = 80


def chosen(sets: list[Path], split: str, count: int) -> list[Path]:
    """Return pictures of as many scenes, evenly over the sets."""
    by_scene = {
        path.stem.rsplit("-", 1)[0]: path for one in sets for path in sorted((one / "images" / split).iterdir())
    }
    every = list(by_scene.values())
    return [every[k * len(every) // count] for k in range(min(count, len(every)))]


def main() -> None:
    """Write OUT as a YOLO data set with ground points."""
    *sets, out = map(Path, sys.argv[1:])
    for split, source_split, count in (("train", "train", TRAIN), ("val", "test", VAL)):
        for kind in ("images", "labels", "points"):
            (out / kind / split).mkdir(parents=True)
        for path in chosen(sets, source_split, count):
            stem = f"{path.parents[2].name}-{path.stem}"
            picture = cv2.resize(cv2.imread(str(path)), SIZE_PX, interpolation=cv2.INTER_AREA)
            cv2.imwrite(str(out / "images" / split / f"{stem}.jpg"), picture, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
            for kind in ("labels", "points"):
                source = path.parents[2] / kind / source_split / f"{path.stem}.txt"
                if source.is_file():
                    shutil.copy(source, out / kind / split / f"{stem}.txt")
    shutil.copy(sets[0] / "data.yaml", out / "data.yaml")
    text = (out / "data.yaml").read_text(encoding="utf-8")
    (out / "data.yaml").write_text(text.replace("test: images/test\n", ""), encoding="utf-8")


if __name__ == "__main__":
    main()
