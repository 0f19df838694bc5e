"""Write a clip: video, telemetry, truth, camera and reference, all in one folder or nothing at all."""

from __future__ import annotations

import json
from collections.abc import Callable, Generator
from contextlib import closing, contextmanager
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import yaml

from standoff import __version__
from standoff.core.classes import CLASSES
from standoff.core.homography import FloatArray
from standoff.core.pose import View
from standoff.simulation.coco import Annotations
from standoff.simulation.crew import work_through
from standoff.simulation.presets import Plan
from standoff.simulation.scene import Actor, Reference
from standoff.simulation.sensor import VideoWriter
from standoff.simulation.site import Site, build_site
from standoff.simulation.studio import Shot, Studio
from standoff.simulation.telemetry import ShownSettings, write_telemetry
from standoff.simulation.truth import FRAMES_SCHEMA, PAIRS_SCHEMA, TRUTH_SCHEMA, Row
from standoff.stages.ground import save_camera
from standoff.stages.sinks.whole import whole_folder

FORMAT = 1
CLIP_FILES = frozenset(
    {
        "video.mp4", "truth.parquet", "pairs.parquet", "frames.parquet", "annotations.json", "scene.json",
        "camera.yaml", "reference.yaml", "telemetry.srt",
    }
)  # fmt: skip
"""What a clip holds."""
"""Of the clip folder; `scene.json` carries it."""


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
        site = build_site(plan)
        times_s = frame_times_s(plan)
        tables = Tables()
        annotations = Annotations()
        size_px = (plan.preset.width_px, plan.preset.height_px)
        shots = work_through(
            partial(open_shooter, plan), list(enumerate(times_s.tolist())), processes=min(processes, len(times_s))
        )
        rate_bps = None if plan.preset.bit_rate_mbps is None else int(plan.preset.bit_rate_mbps * 1e6)
        with closing(shots), VideoWriter(folder / "video.mp4", size_px, bit_rate_bps=rate_bps) as video:
            for shot in shots:
                video.write(shot.image, shot.frame["time_s"])
                tables.add(shot)
                picture = {"file_name": "video.mp4", "frame": shot.index, "time_s": shot.frame["time_s"]}
                annotations.add(picture, shot.entities, size_px, shot.ids if plan.masks else None)
                if on_frame is not None:
                    on_frame()
        tables.save(folder)
        _save_json(annotations.to_dict(f"standoff {plan.name}, seed {plan.seed}"), folder / "annotations.json")
        _save_json(describe_scene(plan, site), folder / "scene.json")
        save_camera(site.camera, folder / "camera.yaml")
        _save_reference(site.scene.reference, site.scene.flight.view(times_s[0]), folder / "reference.yaml")
        errors = np.random.default_rng([plan.seed, 1299709])
        shown = ShownSettings(iso=round(site.sensor.iso), shutter_hz=1 / site.shutter_s)
        write_telemetry(folder / "telemetry.srt", site.scene.flight, times_s, errors, shown)


@contextmanager
def open_shooter(plan: Plan) -> Generator[Callable[[tuple[int, float]], Shot], None, None]:
    """Give a function from a frame's index and time to the frame."""
    with Studio(build_site(plan)) as studio:
        yield lambda job: studio.shoot(*job)


class Tables:
    """Collect the rows of the clip's three tables."""

    def __init__(self) -> None:
        self._entities: list[Row] = []
        self._pairs: list[Row] = []
        self._frames: list[Row] = []

    def add(self, shot: Shot) -> None:
        """Add a frame."""
        self._entities += shot.entities
        self._pairs += shot.pairs
        self._frames.append(shot.frame)

    def save(self, folder: Path) -> None:
        """Write `truth.parquet`, `pairs.parquet` and `frames.parquet`."""
        tables = (("truth", TRUTH_SCHEMA, self._entities), ("pairs", PAIRS_SCHEMA, self._pairs))
        for name, schema, rows in (*tables, ("frames", FRAMES_SCHEMA, self._frames)):
            pq.write_table(pa.Table.from_pylist(rows, schema=schema), folder / f"{name}.parquet")


def describe_scene(plan: Plan, site: Site) -> dict[str, Any]:
    """Return what `scene.json` holds: everything that does not change from frame to frame."""
    scene = site.scene
    return {
        "format": FORMAT,
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
    ground: dict[str, Any] = {"camera": "camera.yaml"}
    if reference is not None:
        first_px = view.project(reference.top_m[:1])[0]
        size_px = (view.camera.width_px, view.camera.height_px)
        hint = {"first_corner_px": first_px.tolist()} if ((first_px >= 0) & (first_px < size_px)).all() else {}
        shape = {"corners_m": reference.top_m[:, :2].tolist(), "height_m": reference.height_m}
        ground["reference"] = {**shape, **hint}
    path.write_text(yaml.safe_dump({"ground": ground}, sort_keys=False))


def _save_json(content: dict[str, Any], path: Path) -> None:
    path.write_text(json.dumps(content))
