"""Clips without pictures, and runs of them: a detector's noisy boxes, a map with an honest error, all else as it is.

The map is the true view after a change that is drawn once for a clip, with the covariance that it was drawn from. The
motion of the picture is exact. Tracks, places and distances are the stages' own, with their defaults.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq

from standoff.clips import NOISY_DETECTIONS_FILE, detections_of, load_clip
from standoff.config import load_settings
from standoff.core import homography, protocols
from standoff.core.homography import FloatArray
from standoff.core.pose import LENS, SHIFT, TURN, View
from standoff.core.types import CameraMotion, Detections, Frame, GroundMap, NoCameraMotion
from standoff.evaluation.coverage import ClipSamples, read_samples
from standoff.evaluation.paper.answers import FrameByFrame, score_frames
from standoff.evaluation.paper.monitored_clip import Notes
from standoff.evaluation.run_frames import RunFrame
from standoff.monitor import Monitor, Run
from standoff.stages.frames import ArrayPicture
from standoff.stages.ground import load_camera, map_from_view
from standoff.stages.hazard import HazardMonitor
from standoff.stages.locate import Locator
from standoff.stages.proximity import ProximityMeter
from standoff.stages.sinks import FRAMES, PROXIMITY, ZONED_TRACKS, TableSink
from standoff.stages.track import Tracker
from standoff.stages.watched import GroundWatcher
from standoff_sim.clip.presets import plan_clip
from standoff_sim.clip.write_clip import record_truth

_TURN_RAD, _SHIFT_M, _FOCAL = 0.003, 0.1, 0.005
"""Standard errors of the view: some decimetres on the ground, 30 m away."""


class _Views(protocols.Source, protocols.Detector):
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
        file = clip / NOISY_DETECTIONS_FILE
        table = pq.read_table(file)
        self._frame_of = table.column("frame").to_numpy()
        self._found = detections_of(table, file)
        sigma = np.zeros(8)
        sigma[TURN], sigma[SHIFT], sigma[LENS] = _TURN_RAD, _SHIFT_M, (_FOCAL, 0.0)
        self._covariance = np.diag(sigma**2)
        self._change: FloatArray = sigma * np.random.default_rng(seed).normal(size=8)

    @property
    def size_px(self) -> tuple[int, int]:
        camera = self._views[0].camera
        return camera.width_px, camera.height_px

    def frames(self) -> Iterator[Frame]:
        width_px, height_px = self.size_px
        nothing = ArrayPicture(np.zeros((height_px, width_px, 3), dtype=np.uint8))
        for k, time_s in enumerate(self.times_s):
            yield Frame("noisy", k, time_s, nothing)

    def close(self) -> None:
        pass

    def detect(self, frame: Frame) -> Detections:
        return self._found[self._frame_of == frame.index]

    def moved(self, frame: Frame) -> CameraMotion | NoCameraMotion:
        then, now = self._views[0], self._views[frame.index]
        forth = now.plane_to_pinhole() @ homography.invert(then.plane_to_pinhole())
        return CameraMotion(forth / np.linalg.norm(forth), np.zeros((9, 9)), self.times_s[0], then.camera)

    def mapped(self, frame: Frame) -> GroundMap:
        view = self._views[frame.index].changed(self._change)
        return map_from_view(view, self._covariance, method="drawn", scale_m_per_px=0.03, anchors_px=np.zeros((0, 2)))


class _Motion(protocols.CameraMotionEstimator):
    def __init__(self, views: _Views) -> None:
        self._views = views

    def update(self, frame: Frame, detections: Detections) -> CameraMotion | NoCameraMotion:
        return self._views.moved(frame)


class _Ground(protocols.Ground):
    def __init__(self, views: _Views) -> None:
        self._views = views

    def update(self, frame: Frame, detections: Detections, motion: object) -> GroundMap:
        return self._views.mapped(frame)


@dataclass(frozen=True, slots=True, eq=False)
class NoisyRun:
    """What was measured of one clip.

    Attributes:
        samples: Distances beside the true ones.
        answers: Danger, warning, clear or unknown in every frame, beside what is true.
    """

    samples: ClipSamples
    answers: FrameByFrame


def run_noisily(preset: str, seed: int, folder: Path, *, frames: int, clutter: float | None = None) -> NoisyRun:
    """Make a clip, run everything after the detector on it, and compare.

    Args:
        preset: Of the clip.
        seed: Of the clip, and of the map's error.
        folder: For both.
        frames: Five a second.
        clutter: In place of the preset's own; most of a site's making is what lies about.
    """
    folder_of_clip, run = folder / f"{preset}-{seed}", folder / f"run-{preset}-{seed}"
    plan = plan_clip(preset, seed=seed, frames=frames, fps=5.0, width_px=1280, height_px=720)
    if clutter is not None:
        plan = replace(plan, preset=replace(plan.preset, clutter=clutter))
    record_truth(plan, folder_of_clip, processes=1)
    run.mkdir()
    views = _Views(folder_of_clip, seed)
    tables = {"tracks": ZONED_TRACKS, "proximity": PROXIMITY, "frames": FRAMES}
    sinks = {name: TableSink(run / f"{name}.parquet", table) for name, table in tables.items()}
    monitor = Monitor(
        detector=views, motion=_Motion(views), ground=_Ground(views), tracker=Tracker(),
        locator=Locator(), watcher=GroundWatcher(), proximity=ProximityMeter(), hazard=HazardMonitor(),
    )  # fmt: skip
    clip = load_clip(folder_of_clip, with_film=False)
    settings = load_settings(clip.settings_file)
    assert settings.ground.reference is not None
    notes = Notes(clip, settings.ground.reference.shape(), views.size_px, true_ids=False)
    noisy = Run(views, monitor, sinks)
    for result in noisy:
        notes.take(RunFrame.of_result(result))
    assert not noisy.sink_errors
    return NoisyRun(read_samples(run, folder_of_clip), score_frames(clip, notes.monitored, settings))
