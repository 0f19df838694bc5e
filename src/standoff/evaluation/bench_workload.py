"""A made-up site under the real stages: how long the monitor itself takes, whatever the decoder and the model cost.

A camera 20 m up sees workers and machines walk in circles. Their boxes come from a script, so no model runs;
the pictures are decoded already, but still have to be converted by whoever wants their pixels; the annotated
video is drawn but not encoded.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Literal

import av
import cv2
import numpy as np

from standoff.core import homography, protocols
from standoff.core.classes import CLASS_BY_NAME, CLASSES, Role, class_ids
from standoff.core.homography import FloatArray
from standoff.core.protocols import Ground, Sink
from standoff.core.types import Detections, Frame, FrameResult, ImageArray, Outcome
from standoff.evaluation.timing import StageTimes, collect_times
from standoff.monitor import Monitor, Run
from standoff.stages.frames import AvPicture, Scaler
from standoff.stages.ground import ReferenceGround, ReferenceShape, SurveyedGround
from standoff.stages.hazard import HazardMonitor
from standoff.stages.locate import Locator
from standoff.stages.motion import MotionEstimator
from standoff.stages.proximity import ProximityMeter
from standoff.stages.sinks import (
    FRAMES,
    PROXIMITY,
    TRACKS,
    Composer,
    FrameMeasurements,
    HazardSink,
    ReportSink,
    TableSink,
    VideoParams,
)
from standoff.stages.track import Tracker
from standoff.stages.watched import GroundWatcher
from standoff.testing import ScriptedDetector

_RATE_FPS = 30.0
_CAMERA_HEIGHT_M = 20.0
_CAMERA_PITCH_DEG = 35.0
_FOCAL_WIDTHS = 0.78
_WORKERS_IN_TEN = 6
_JITTER_PX = 1.0
_SURVEYED_M = np.array([[-12.0, 20.0], [12.0, 20.0], [16.0, 40.0], [-16.0, 40.0], [0.0, 30.0], [4.0, 24.0]])
_REFERENCE_M = np.array([[-1.5, 24.0], [1.5, 24.0], [1.5, 27.0], [-1.5, 27.0]])


class BenchSite:
    """Where everything is and what the camera sees of it.

    Args:
        size_px: (width, height) of the pictures.
        tracks: Entities: six in ten are workers, the others machines of all kinds.
    """

    def __init__(self, size_px: tuple[int, int], tracks: int) -> None:
        self.size_px = size_px
        self._focal_px = _FOCAL_WIDTHS * size_px[0]
        self.ground_to_image = self._camera_matrix()
        machines = class_ids(Role.EQUIPMENT)
        workers = round(tracks * _WORKERS_IN_TEN / 10)
        kinds = [0] * workers + [machines[i % len(machines)] for i in range(tracks - workers)]
        self._class_id = np.array(kinds, dtype=np.int64)
        self._size_m = np.array([(CLASSES[kind].length_m, CLASSES[kind].height_m) for kind in kinds]).reshape(-1, 2)
        rng = np.random.default_rng(0)
        self._centre_m = np.column_stack([rng.uniform(-11, 11, tracks), rng.uniform(21, 40, tracks)])
        self._radius_m = rng.uniform(1, 3, tracks)
        self._turn_radps = rng.uniform(0.2, 0.5, tracks)

    def _camera_matrix(self) -> FloatArray:
        pitch = np.radians(_CAMERA_PITCH_DEG)
        width_px, height_px = self.size_px
        intrinsic = np.array(
            [[self._focal_px, 0, (width_px - 1) / 2], [0, self._focal_px, (height_px - 1) / 2], [0, 0, 1]]
        )
        right, down = [1.0, 0.0, 0.0], [0.0, -np.sin(pitch), -np.cos(pitch)]
        site_to_camera = np.array([right, down, [0.0, np.cos(pitch), -np.sin(pitch)]])
        shift = -site_to_camera @ np.array([0.0, 0.0, _CAMERA_HEIGHT_M])
        matrix: FloatArray = intrinsic @ np.column_stack([site_to_camera[:, :2], shift])
        return matrix

    def to_image(self, points_m: FloatArray) -> FloatArray:
        """Return (N, 2) picture points of (N, 2) points on the ground."""
        return homography.apply(self.ground_to_image, points_m)[0]

    def detections(self, index: int) -> Detections:
        """Return all entities' boxes, a pixel of noise on them, and the reference object's."""
        angle = self._turn_radps * index / _RATE_FPS
        stand_m = self._centre_m + self._radius_m[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
        foot_px = self.to_image(stand_m)
        depth_m = np.hypot(stand_m[:, 1], _CAMERA_HEIGHT_M)
        wide_px, high_px = (self._focal_px * self._size_m / depth_m[:, None]).T
        boxes = np.column_stack(
            [foot_px[:, 0] - wide_px / 2, foot_px[:, 1] - high_px, foot_px[:, 0] + wide_px / 2, foot_px[:, 1]]
        )
        boxes += np.random.default_rng(index).normal(0, _JITTER_PX, boxes.shape)
        corners_px = self.to_image(_REFERENCE_M)
        reference = np.concatenate([corners_px.min(axis=0) - 6, corners_px.max(axis=0) + 6])
        return Detections(
            np.vstack([boxes, reference]),
            np.full(len(boxes) + 1, 0.9),
            np.append(self._class_id, CLASS_BY_NAME["reference"].id),
        )

    def picture(self) -> ImageArray:
        """Draw the ground, rough, with a light reference square on it."""
        width_px, height_px = self.size_px
        rough = np.random.default_rng(1).normal(90, 12, (height_px // 4, width_px // 4, 3)).clip(0, 255)
        picture: ImageArray = cv2.resize(rough.astype(np.uint8), self.size_px, interpolation=cv2.INTER_LINEAR)
        outline = np.rint(self.to_image(_REFERENCE_M) * 16).astype(np.int32)
        cv2.fillConvexPoly(picture, outline, (220, 220, 220), cv2.LINE_AA, 4)
        return picture

    def ground(self, kind: Literal["surveyed", "reference"]) -> Ground:
        """Return a ground stage that knows the site."""
        if kind == "reference":
            return ReferenceGround(ReferenceShape.from_corners(_REFERENCE_M))
        return SurveyedGround(self.to_image(_SURVEYED_M), _SURVEYED_M, self.size_px)


class SiteFilm(protocols.Source):
    """A film of the site: the same YUV picture again and again, unconverted each time.

    Args:
        site: What it shows.
        count: How many frames it has.
    """

    def __init__(self, site: BenchSite, count: int) -> None:
        self._site, self._count = site, count

    @property
    def size_px(self) -> tuple[int, int]:
        """(width, height) of every frame."""
        return self._site.size_px

    def frames(self) -> Iterator[Frame]:
        """Yield the frames."""
        decoded = av.VideoFrame.from_ndarray(self._site.picture(), format="bgr24").reformat(format="yuv420p")
        scaler = Scaler()
        for index in range(self._count):
            yield Frame("workload", index, index / _RATE_FPS, AvPicture(decoded, scaler=scaler))

    def close(self) -> None:
        """Do nothing: there is no file."""


class DrawingSink:
    """Draw the annotated video without encoding it."""

    def __init__(self, params: VideoParams | None = None) -> None:
        self._params = params or VideoParams()
        self._composer: Composer | None = None

    def write(self, result: FrameResult) -> None:
        """Draw this frame."""
        frame = result.frame
        self._composer = self._composer or Composer(frame.size_px, self._params)
        size_px = self._composer.picture_size_px
        picture = frame.image if size_px == frame.size_px else frame.picture.resized_bgr(*size_px)
        self._composer.compose(picture, FrameMeasurements.of(result))

    def close(self, outcome: Outcome) -> None:
        """Do nothing: there is no file."""


def monitor_workload(
    size_px: tuple[int, int] = (1920, 1080),
    tracks: int = 10,
    frames: int = 200,
    ground: Literal["surveyed", "reference"] = "surveyed",
) -> StageTimes:
    """Run the real stages on a made-up site and time them.

    Args:
        size_px: (width, height) of the pictures.
        tracks: Entities on the site, all in view.
        frames: How many.
        ground: A fixed map from surveyed points, or the reference object found anew in each frame.

    Returns:
        Each frame's milliseconds; `own_work()` of it is what the monitor itself costs.
    """
    site = BenchSite(size_px, tracks)
    with TemporaryDirectory() as folder:
        monitor = Monitor(
            detector=ScriptedDetector({index: site.detections(index) for index in range(frames)}),
            motion=MotionEstimator(),
            ground=site.ground(ground),
            tracker=Tracker(),
            locator=Locator(),
            watcher=GroundWatcher(),
            proximity=ProximityMeter(),
            hazard=HazardMonitor(),
        )
        return collect_times(Run(SiteFilm(site, frames), monitor, workload_sinks(Path(folder))))


def workload_sinks(folder: Path, *, film: bool = True) -> dict[str, Sink]:
    """Return what a run writes by default, the film drawn but not encoded, by name.

    Args:
        folder: Where the files go.
        film: False: no film is drawn.
    """
    tables = {"tracks": TRACKS, "proximity": PROXIMITY, "frames": FRAMES}
    sinks: dict[str, Sink] = {name: TableSink(folder / f"{name}.parquet", table) for name, table in tables.items()}
    drawing: dict[str, Sink] = {"drawing": DrawingSink()} if film else {}
    return sinks | {
        "hazards": HazardSink(folder / "hazards.jsonl"),
        **drawing,
        "report": ReportSink(folder / "report.html"),
    }
