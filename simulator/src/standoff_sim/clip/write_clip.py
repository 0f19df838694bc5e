"""Write a clip: video, telemetry, truth, camera and reference, all in one folder or nothing at all."""

from __future__ import annotations

import json
from collections.abc import Callable, Generator, Sequence
from contextlib import AbstractContextManager, ExitStack, closing, contextmanager
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from standoff import __version__
from standoff.clips import (
    ANNOTATIONS_FILE,
    CAMERA_FILE,
    CLIP_FILES,
    CLIP_FORMAT,
    CLIP_FRAMES_FILE,
    CLIP_FRAMES_SCHEMA,
    DEVICES_FILE,
    DEVICES_SCHEMA,
    NOISY_DETECTIONS_FILE,
    NOISY_DETECTIONS_SCHEMA,
    PAIRS_FILE,
    PAIRS_SCHEMA,
    REFERENCE_FILE,
    SCENE_FILE,
    TELEMETRY_FILE,
    TRUTH_FILE,
    TRUTH_SCHEMA,
    VIDEO_FILE,
)
from standoff.core.classes import CLASSES
from standoff.core.homography import FloatArray
from standoff.core.pose import View
from standoff.files.whole import whole_folder
from standoff.files.yaml_text import write_yaml
from standoff_sim.camera.sensor import VideoWriter
from standoff_sim.camera.telemetry import Origin, ShownSettings, write_telemetry
from standoff_sim.clip.coco import Annotations
from standoff_sim.clip.detection_noise import NoisyDetector
from standoff_sim.clip.presets import Plan
from standoff_sim.clip.processes import work_through
from standoff_sim.clip.site_truth import SiteTruth
from standoff_sim.clip.studio import RenderedFrame, Studio
from standoff_sim.clip.truth import FrameTruth, Row
from standoff_sim.clip.wearables import report_positions
from standoff_sim.scene.scene import Actor, Reference
from standoff_sim.scene.site import Site, build_site

Made = TypeVar("Made")

_AHEAD_ROWS = 20_000
"""Rows that are kept until they are written: hours of site time do not fit into the memory."""
_EARTH, _DEVICES, _DETECTIONS = 1299709, 32452843, 49979687
"""With the seed: the streams of the place on Earth and the drone's instruments, of wearables, of noisy detections."""


def frame_times_s(plan: Plan) -> FloatArray:
    """Return (N,) presentation times.

    With a variable rate each interval is 0.8-1.2 of the nominal one, and one frame in forty is dropped by the camera.
    """
    count, interval_s = plan.preset.frames, 1.0 / plan.preset.fps
    if not plan.variable_rate:
        return np.arange(count, dtype=np.float64) * interval_s
    rng = np.random.default_rng([plan.seed, 104729])
    intervals_s = interval_s * rng.uniform(0.8, 1.2, count - 1) * rng.choice([1.0, 2.0], count - 1, p=[0.975, 0.025])
    return np.concatenate([np.zeros(1), np.cumsum(intervals_s)])


def record_clip(
    plan: Plan, out: Path, *, overwrite: bool = False, processes: int = 2, on_frame: Callable[[], None] | None = None
) -> None:
    """Render a clip.

    Args:
        plan: What to render.
        out: The folder; appears when the clip is whole.
        overwrite: Replace an existing folder.
        processes: That render side by side; the result is the same for any number.
        on_frame: Called after each frame.

    Raises:
        OutputError: The folder cannot be used.
        MissingDependency: No OpenGL.
    """
    with whole_folder(out, overwrite=overwrite, own=CLIP_FILES) as folder:
        site, times_s = build_site(plan), frame_times_s(plan)
        annotations = Annotations()
        size_px = (plan.preset.width_px, plan.preset.height_px)
        shots = _work(open_shooter, plan, site, times_s, processes)
        rate_bps = None if plan.preset.bit_rate_mbps is None else int(plan.preset.bit_rate_mbps * 1e6)
        film = VideoWriter(folder / VIDEO_FILE, size_px, bit_rate_bps=rate_bps)
        with closing(shots), film as video, Tables(folder) as tables:
            for shot in shots:
                video.write(shot.image, shot.frame["time_s"])
                tables.add(shot)
                picture = {"file_name": VIDEO_FILE, "frame": shot.index, "time_s": shot.frame["time_s"]}
                annotations.add(picture, shot.entities, size_px, shot.ids if plan.masks else None)
                if on_frame is not None:
                    on_frame()
        _save_json(annotations.to_dict(f"standoff {plan.name}, seed {plan.seed}"), folder / ANNOTATIONS_FILE)
        _save_surroundings(plan, site, times_s, folder)


def record_truth(
    plan: Plan, out: Path, *, overwrite: bool = False, processes: int = 2, on_frame: Callable[[], None] | None = None
) -> None:
    """Write a clip's truth, its telemetry and what a detector might find, without a picture.

    Positions are those of the rendered clip, bit for bit; what is visible is approximated, see
    `standoff_sim.scene.occlusion`. There are `detections.parquet` instead of `video.mp4` and `annotations.json`.

    Args:
        plan: What to write.
        out: The folder; appears when the clip is whole.
        overwrite: Replace an existing folder.
        processes: That work side by side; the result is the same for any number.
        on_frame: Called after each frame.

    Raises:
        OutputError: The folder cannot be used.
    """
    with whole_folder(out, overwrite=overwrite, own=CLIP_FILES) as folder:
        site, times_s = build_site(plan), frame_times_s(plan)
        size_px = (plan.preset.width_px, plan.preset.height_px)
        detector = NoisyDetector(size_px, np.random.default_rng([plan.seed, _DETECTIONS, plan.camera]))
        truths = _work(open_site_truth, plan, site, times_s, processes)
        with closing(truths), Tables(folder, detected=True) as tables:
            for truth in truths:
                found = detector.detect(truth.index, truth.frame["time_s"], truth.entities)
                tables.add(truth, found)
                if on_frame is not None:
                    on_frame()
        _save_surroundings(plan, site, times_s, folder)


def record_cameras(
    record: Callable[..., None], plan: Plan, out: Path, *, cameras: int, overwrite: bool = False,
    on_frame: Callable[[], None] | None = None, processes: int = 2,
) -> None:  # fmt: skip
    """Write a clip of each of several drones over one scene: `camera-1`, `camera-2` in one folder.

    Args:
        record: `record_clip` or `record_truth`.
        plan: Of the first drone; the others see the same scene, at the same times, from other sides.
        out: The folder; appears when all clips are whole.
        cameras: How many.
        overwrite: Replace an existing folder.
        on_frame: Called after each frame of each drone.
        processes: That work side by side.
    """
    names = [f"camera-{number}" for number in range(1, cameras + 1)]
    with whole_folder(out, overwrite=overwrite, own=names) as folder:
        for number, name in enumerate(names, 1):
            record(replace(plan, camera=number), folder / name, processes=processes, on_frame=on_frame)


def _work(
    factory: Callable[..., AbstractContextManager[Callable[[tuple[int, float]], Made]]], plan: Plan, site: Site,
    times_s: FloatArray, processes: int,
) -> Generator[Made, None, None]:  # fmt: skip
    jobs = list(enumerate(times_s.tolist()))
    processes = min(processes, len(jobs))
    # a site does not travel to another process: there it is built again
    worker = partial(factory, plan, site) if processes == 1 else partial(factory, plan)
    return work_through(worker, jobs, processes=processes)


@contextmanager
def open_shooter(
    plan: Plan, site: Site | None = None
) -> Generator[Callable[[tuple[int, float]], RenderedFrame], None, None]:
    """Give a function from a frame's index and time to the frame; the site is built where it is not given."""
    with Studio(site or build_site(plan)) as studio:
        yield lambda job: studio.shoot(*job)


@contextmanager
def open_site_truth(
    plan: Plan, site: Site | None = None
) -> Generator[Callable[[tuple[int, float]], FrameTruth], None, None]:
    """Give a function from a frame's index and time to what is true in it; it draws nothing."""
    truth = SiteTruth(site or build_site(plan))
    yield lambda job: truth.at(*job)


class Tables:
    """Write the rows of a clip's tables as they come; a context manager.

    Args:
        folder: Where `truth.parquet`, `pairs.parquet` and `frames.parquet` go.
        detected: Whether `detections.parquet` is written as well.
    """

    def __init__(self, folder: Path, *, detected: bool = False) -> None:
        schemas = {TRUTH_FILE: TRUTH_SCHEMA, PAIRS_FILE: PAIRS_SCHEMA, CLIP_FRAMES_FILE: CLIP_FRAMES_SCHEMA}
        schemas |= {NOISY_DETECTIONS_FILE: NOISY_DETECTIONS_SCHEMA} if detected else {}
        self._rows: dict[str, list[Row]] = {name: [] for name in schemas}
        self._stack = ExitStack()
        self._writers = {
            name: self._stack.enter_context(pq.ParquetWriter(folder / name, schema)) for name, schema in schemas.items()
        }

    def __enter__(self) -> Tables:
        return self

    def __exit__(self, failure: type[BaseException] | None, *_: object) -> None:
        with self._stack:
            if failure is None:
                self._flush(least=0)

    def add(self, truth: RenderedFrame | FrameTruth, detections: Sequence[Row] = ()) -> None:
        """Add a frame."""
        added = {
            TRUTH_FILE: truth.entities,
            PAIRS_FILE: truth.pairs,
            CLIP_FRAMES_FILE: [truth.frame],
            NOISY_DETECTIONS_FILE: detections,
        }
        for name, rows in self._rows.items():
            rows += added[name]
        self._flush(least=_AHEAD_ROWS)

    def _flush(self, *, least: int) -> None:
        for name, rows in self._rows.items():
            if len(rows) >= max(least, 1):
                self._writers[name].write_table(pa.Table.from_pylist(rows, schema=self._writers[name].schema))
                rows.clear()


def _save_surroundings(plan: Plan, site: Site, times_s: FloatArray, folder: Path) -> None:
    """Write what does not come frame by frame: scene, camera, reference object, telemetry, wearables."""
    # numba, which comes with it, takes long to load, and every process that renders would wait for it
    from standoff.stages.ground import save_camera

    _save_json(describe_scene(plan, site), folder / SCENE_FILE)
    save_camera(site.camera, folder / CAMERA_FILE)
    _save_reference(site.scene.reference, site.scene.flight.view(times_s[0]), folder / REFERENCE_FILE)
    origin = Origin.draw(np.random.default_rng([plan.seed, _EARTH]))
    errors = np.random.default_rng([plan.seed, _EARTH])
    if plan.camera == 1:
        Origin.draw(errors)  # the errors come after the place, from the same stream
    else:
        errors = np.random.default_rng([plan.seed, _EARTH, plan.camera])
    shown = ShownSettings(iso=round(site.sensor.iso), shutter_hz=1 / site.shutter_s)
    write_telemetry(folder / TELEMETRY_FILE, site.scene.flight, times_s, errors, shown, origin=origin)
    if plan.devices:
        reports = report_positions(site.scene, float(times_s[-1]), origin, np.random.default_rng([plan.seed, _DEVICES]))
        pq.write_table(pa.Table.from_pylist(reports, schema=DEVICES_SCHEMA), folder / DEVICES_FILE)


def describe_scene(plan: Plan, site: Site) -> dict[str, Any]:
    """Return what `scene.json` holds: everything that does not change from frame to frame."""
    scene = site.scene
    return {
        "format": CLIP_FORMAT,
        "standoff": __version__,
        "seed": plan.seed,
        "preset": plan.name,
        **{name: value for name, value in asdict(plan.preset).items() if name not in ("summary", "covers")},
        "variable_rate": plan.variable_rate,
        "stature_m": plan.stature_m,
        "stooping": plan.stooping,
        "camera": plan.camera,
        "entities": [_describe_actor(actor) for actor in scene.actors],
        "reference": None if scene.reference is None else _describe_reference(scene.reference),
        "board": None
        if site.board_m is None
        else {"corners_m": site.board_m.tolist(), "square_m": float(np.linalg.norm(site.board_m[1] - site.board_m[0]))},
    }


def _describe_actor(actor: Actor) -> dict[str, Any]:
    length_m, width_m = np.ptp(actor.model.footprint_m, axis=0).tolist()
    return {
        "entity_id": actor.entity_id,
        "class_name": CLASSES[actor.model.class_id].name,
        "height_m": actor.model.height_m,
        "length_m": length_m,
        "width_m": width_m,
    }


def _describe_reference(reference: Reference) -> dict[str, Any]:
    return {
        "entity_id": reference.entity_id,
        "top_m": reference.top_m.tolist(),
        "base_m": reference.base_m.tolist(),
        "ground_m": reference.ground_m,
        "height_m": reference.height_m,
        "covers": [{"start_s": cover.start_s, "stop_s": cover.stop_s} for cover in reference.covers],
    }


def _save_reference(reference: Reference | None, view: View, path: Path) -> None:
    """Write settings with the reference object's shape; a hint tells its corners apart where its shape does not."""
    ground: dict[str, Any] = {"camera": CAMERA_FILE}
    if reference is not None:
        first_px = view.project(reference.top_m[:1])[0]
        size_px = (view.camera.width_px, view.camera.height_px)
        hint = {"first_corner_px": first_px.tolist()} if ((first_px >= 0) & (first_px < size_px)).all() else {}
        shape = {"corners_m": reference.top_m[:, :2].tolist(), "height_m": reference.height_m}
        ground["reference"] = {**shape, **hint}
    write_yaml(path, {"ground": ground})


def _save_json(content: dict[str, Any], path: Path) -> None:
    path.write_text(json.dumps(content))
