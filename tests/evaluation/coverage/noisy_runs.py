"""Clips without pictures, and runs of them: a detector's noisy boxes, a map with an honest error, all else as it is.

The map is the true view after a change that is drawn once for a clip, with the covariance that it was drawn from. The
motion of the picture is exact. Tracks, places and distances are the stages' own, with their defaults.
"""

from __future__ import annotations

from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq

from standoff.core import homography
from standoff.core.classes import CLASS_BY_NAME
from standoff.core.homography import FloatArray
from standoff.core.pose import LENS, SHIFT, TURN, View
from standoff.core.types import CameraMotion, Detections, Frame, GroundMap, NoCameraMotion
from standoff.evaluation.coverage import ClipSamples, read_samples
from standoff.pipeline import Pipeline
from standoff.simulation.presets import plan_clip
from standoff.simulation.record import record_truth
from standoff.stages.frames import ArrayPicture
from standoff.stages.ground import load_camera, map_from_view
from standoff.stages.hazard import HazardMonitor
from standoff.stages.locate import Locator
from standoff.stages.proximity import ProximityMeter
from standoff.stages.sinks import FRAMES, PROXIMITY, TableSink, tracks_table
from standoff.stages.track import Tracker
from standoff.stages.watched import GroundWatcher

_TURN_RAD, _SHIFT_M, _FOCAL = 0.003, 0.1, 0.005
"""Standard errors of the view: some decimetres on the ground, 30 m away."""
_BOX = ("x1_px", "y1_px", "x2_px", "y2_px")


class _Views:
    """A clip's camera in every frame: detector, motion and ground stage in one, as far as they need it."""

    def __init__(self, clip: Path, seed: int) -> None:
        camera = load_camera(clip / "camera.yaml")
        frames = pq.read_table(clip / "frames.parquet").to_pydict()
        self.times_s: list[float] = frames["time_s"]
        places = zip(*(frames[f"camera_{axis}_m"] for axis in "xyz"), strict=True)
        self._views = [
            View(camera, np.array(place), np.array(turn).reshape(3, 3))
            for place, turn in zip(places, frames["site_to_camera"], strict=True)
        ]
        rows = pq.read_table(clip / "detections.parquet").to_pydict()
        self._frame_of = np.array(rows["frame"], dtype=np.int64)
        class_id = [CLASS_BY_NAME[name].id for name in rows["class"]]
        boxes_px = np.array([rows[side] for side in _BOX], dtype=np.float64).T
        self._found = Detections(boxes_px, np.array(rows["score"]), np.array(class_id, dtype=np.int64))
        sigma = np.zeros(8)
        sigma[TURN], sigma[SHIFT], sigma[LENS] = _TURN_RAD, _SHIFT_M, (_FOCAL, 0.0)
        self._covariance = np.diag(sigma**2)
        self._change: FloatArray = sigma * np.random.default_rng(seed).normal(size=8)

    def frames(self) -> list[Frame]:
        camera = self._views[0].camera
        nothing = ArrayPicture(np.zeros((camera.height_px, camera.width_px, 3), dtype=np.uint8))
        return [Frame("noisy", k, time_s, nothing) for k, time_s in enumerate(self.times_s)]

    def detect(self, frame: Frame) -> Detections:
        return self._found[self._frame_of == frame.index]

    def moved(self, frame: Frame) -> CameraMotion | NoCameraMotion:
        then, now = self._views[0], self._views[frame.index]
        forth = now.plane_to_pinhole() @ homography.invert(then.plane_to_pinhole())
        return CameraMotion(forth / np.linalg.norm(forth), np.zeros((9, 9)), self.times_s[0], then.camera)

    def mapped(self, frame: Frame) -> GroundMap:
        view = self._views[frame.index].changed(self._change)
        return map_from_view(view, self._covariance, method="drawn", scale_m_per_px=0.03, anchors_px=np.zeros((0, 2)))


class _Motion:
    def __init__(self, views: _Views) -> None:
        self._views = views

    def update(self, frame: Frame, detections: Detections) -> CameraMotion | NoCameraMotion:
        return self._views.moved(frame)


class _Ground:
    def __init__(self, views: _Views) -> None:
        self._views = views

    def update(self, frame: Frame, detections: Detections, motion: object) -> GroundMap:
        return self._views.mapped(frame)


def samples_of(preset: str, seed: int, folder: Path, *, frames: int, clutter: float | None = None) -> ClipSamples:
    """Make a clip, run everything after the detector on it, and compare.

    Args:
        preset: Of the clip.
        seed: Of the clip, and of the map's error.
        folder: For both.
        frames: Five a second.
        clutter: In place of the preset's own; most of a site's making is what lies about.
    """
    clip, run = folder / f"{preset}-{seed}", folder / f"run-{preset}-{seed}"
    plan = plan_clip(preset, seed=seed, frames=frames, fps=5.0, width_px=1280, height_px=720)
    if clutter is not None:
        plan = replace(plan, preset=replace(plan.preset, clutter=clutter))
    record_truth(plan, clip, processes=1)
    run.mkdir()
    views = _Views(clip, seed)
    tables = {"tracks": tracks_table(), "proximity": PROXIMITY, "frames": FRAMES}
    sinks = {name: TableSink(run / f"{name}.parquet", table) for name, table in tables.items()}
    pipeline = Pipeline(
        frames=views.frames(), detector=views, motion=_Motion(views), ground=_Ground(views), tracker=Tracker(),
        locator=Locator(), watcher=GroundWatcher(), proximity=ProximityMeter(), hazard=HazardMonitor(), sinks=sinks,
    )  # fmt: skip
    with closing(pipeline.run()) as results:
        for _ in results:
            pass
    assert not pipeline.sink_errors
    return read_samples(run, clip)
