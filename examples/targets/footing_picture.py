"""Draw what to measure of a footing, on a frame of the film that comes with standoff: docs/pictures/footing.jpg."""

from __future__ import annotations

import sys
from importlib.resources import files
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
from matplotlib.font_manager import findfont
from PIL import Image, ImageDraw, ImageFont

from standoff.core.homography import FloatArray
from standoff.drawing.palette import HEX
from standoff.stages.frames import open_source

FILM = Path(str(files("standoff"))) / "demo"
FRAME = 100
LEFT_PX, TOP_PX, WIDTH_PX, HEIGHT_PX = 745, 540, 380, 270
TIMES = 3
LINE_PX, TEXT_PX = 5, 40


def corners(name: str) -> FloatArray:
    """Return the true corners (4, 2) of the footing's top or base, in pixels of the picture that is drawn."""
    row = pq.read_table(FILM / "frames.parquet").slice(FRAME, 1).to_pylist()[0]
    in_film = np.column_stack([row[f"reference_{name}_x_px"], row[f"reference_{name}_y_px"]])
    # The centre of the first pixel is (0, 0), here and there.
    return (in_film - [LEFT_PX, TOP_PX] + 0.5) * TIMES - 0.5


def say(draw: ImageDraw.ImageDraw, text: str, at: FloatArray) -> None:
    """Write a letter on a dark plate."""
    font = ImageFont.truetype(findfont("DejaVu Sans:bold"), TEXT_PX)
    box = draw.textbbox(tuple(at), text, font=font, anchor="mm")
    draw.rounded_rectangle((box[0] - 10, box[1] - 8, box[2] + 10, box[3] + 8), 8, fill=HEX["dark"])
    draw.text(tuple(at), text, fill=HEX["light"], font=font, anchor="mm")


def main() -> None:
    """Write the picture to the path that is given."""
    with open_source(FILM / "video.mp4") as source:
        frame = next(one for one in source.frames() if one.index == FRAME)
    cut = frame.image[TOP_PX : TOP_PX + HEIGHT_PX, LEFT_PX : LEFT_PX + WIDTH_PX, ::-1]
    picture = Image.fromarray(cut).resize((WIDTH_PX * TIMES, HEIGHT_PX * TIMES), Image.Resampling.LANCZOS)
    draw = ImageDraw.Draw(picture)
    top, base = corners("top"), corners("base")
    middle = top.mean(axis=0)
    draw.line([tuple(top[0]), tuple(top[2])], fill=HEX["light"], width=LINE_PX - 2)
    say(draw, "e", middle)
    for k, letter in enumerate("abcd"):
        start, end = top[k], top[(k + 1) % 4]
        draw.line([tuple(start), tuple(end)], fill=HEX["reference"], width=LINE_PX)
        side = (start + end) / 2
        # Into the top, so that no letter hides the edge or the ground beside it.
        say(draw, letter, side + 0.22 * (middle - side))
    nearest = int(top[:, 1].argmax())
    draw.line([tuple(top[nearest]), tuple(base[nearest])], fill=HEX["warning"], width=LINE_PX)
    say(draw, "h", base[nearest] + [0, 45])
    picture.save(sys.argv[1], quality=80)


if __name__ == "__main__":
    main()
