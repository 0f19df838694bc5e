"""How well people's sizes alone tell metres: clips of `standoff simulate PRESET --truth-only`, nothing else told.

python examples/nothing_told.py CLIP...

The detections are the clip's noisy ones, the motion of the picture is exact; camera, height and scale are unknown.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq

from standoff.core import homography
from standoff.core.classes import CLASS_BY_NAME
from standoff.core.homography import FloatArray
from standoff.core.pose import View
from standoff.core.types import CameraMotion, Detections, Frame, GroundMap
from standoff.stages.frames import ArrayPicture
from standoff.stages.ground import FusedGround, load_camera

_PAIR = np.array([[0.42, 0.6], [0.58, 0.6]])
"""Two points of the picture, as shares of it, whose distance on the ground is compared."""


def scale_error(clip: Path) -> tuple[float, float] | str:
    """Return the logarithm of how many times too long lengths are at the clip's end, and its standard error."""
    camera = load_camera(clip / "camera.yaml")
    size_px = camera.width_px, camera.height_px
    nothing_to_see = ArrayPicture(np.zeros((camera.height_px, camera.width_px, 3), dtype=np.uint8))
    frames = pq.read_table(clip / "frames.parquet").to_pydict()
    rows = pq.read_table(clip / "detections.parquet").to_pydict()
    frame_of, boxes = np.array(rows["frame"]), np.array([rows[f"{side}_px"] for side in ("x1", "y1", "x2", "y2")]).T
    classes = np.array([CLASS_BY_NAME[name].id for name in rows["class"]])
    scores = np.array(rows["score"])
    views = [
        View(camera, np.array(place), np.array(turn).reshape(3, 3))
        for *place, turn in zip(*(frames[f"camera_{axis}_m"] for axis in "xyz"), frames["site_to_camera"], strict=True)
    ]
    ground = FusedGround()
    result: object = None
    for k, (view, time_s) in enumerate(zip(views, frames["time_s"], strict=True)):
        mine = frame_of == k
        detections = Detections(boxes[mine], scores[mine], classes[mine])
        motion = _motion(views[0], view, frames["time_s"][0])
        result = ground.update(Frame(clip.name, k, time_s, nothing_to_see), detections, motion)
    if not isinstance(result, GroundMap):
        return str(getattr(result, "reason", "no frame"))
    pair_px = _PAIR * size_px
    found_m, _ = result.to_ground(pair_px)
    true_m = views[-1].to_plane(pair_px)
    ratio = np.linalg.norm(found_m[1] - found_m[0]) / np.linalg.norm(true_m[1] - true_m[0])
    return float(np.log(ratio)), ground.length_sigma


def _motion(then: View, now: View, keyframe_s: float) -> CameraMotion:
    forth: FloatArray = now.plane_to_pinhole() @ homography.invert(then.plane_to_pinhole())
    return CameraMotion(forth / np.linalg.norm(forth), np.zeros((9, 9)), keyframe_s, then.camera)


def main() -> None:
    """Print each clip, then the whole."""
    found = []
    for clip in map(Path, sys.argv[1:]):
        told = scale_error(clip)
        if isinstance(told, str):
            print(f"{clip.name}: no map: {told}")
            continue
        found.append(told)
        print(f"{clip.name}: lengths {100 * (np.exp(told[0]) - 1):+.1f} %, stated {100 * told[1]:.0f} %")
    if found:
        logs, sigmas = np.array(found).T
        inside = np.abs(logs) <= 1.96 * sigmas
        middle = 100 * np.median(np.abs(np.expm1(logs)))
        print(f"{len(found)} of {len(sys.argv) - 1} clips have a map; lengths off by {middle:.1f} % in the median")
        print(f"inside their 95 % interval: {100 * inside.mean():.0f} %")


if __name__ == "__main__":
    main()
