"""Pictures of many independent scenes for training, split by scene, in YOLO's or COCO's layout."""

from __future__ import annotations

from collections.abc import Callable, Generator
from contextlib import closing, contextmanager
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Literal, TypeAlias, get_args

import cv2
import numpy as np

from standoff.core.pose import View
from standoff.files.whole import whole_folder
from standoff.labels.types import Split
from standoff_sim.camera.viewpoints import Obstacles, draw_flight, draw_view
from standoff_sim.clip.picture_set import SET_FILES, LabelledImage, PictureSet, draw_split, is_marked
from standoff_sim.clip.presets import MAX_SEED, Condition, CoverPlan, Plan, Preset, check_seed, check_size
from standoff_sim.clip.processes import work_through
from standoff_sim.clip.studio import Studio
from standoff_sim.clip.truth import Row
from standoff_sim.ground.site_plans import SiteStyle
from standoff_sim.render import Look
from standoff_sim.scene.covers import COVER_KINDS
from standoff_sim.scene.moment import scene_at
from standoff_sim.scene.scene import Scene
from standoff_sim.scene.site import Site, build_site

CastName: TypeAlias = Literal["random", "excavators", "machines"]
_SCENE_FRAMES = 240
_SHUTTERS_S = (0.0, 0.0, 1 / 240, 1 / 100)
"""Least exposure times: how much a passing drone smears its pictures."""
_CONDITION_SHARES = (0.22, 0.26, 0.12, 0.12, 0.22, 0.06)


@dataclass(frozen=True, slots=True)
class DatasetPlan:
    """What to render.

    Attributes:
        images: How many in all.
        per_scene: Pictures of each scene.
        width_px: Of the pictures.
        height_px: Of the pictures.
        layout: Of the annotations.
        held_out: Share of scenes for each of val and test.
        seed: Of everything random.
        excavator_mesh: Folder of mesh parts for some of the excavators, or None.
        mesh_share: Of the scenes whose excavators are made of them.
        cast: Who is there: `random`, few or many of all kinds; `excavators` or `machines`, as many as find room of
            these or of all other kinds, with some people.

    Raises:
        ConfigError: A size or seed out of range.
    """

    images: int
    per_scene: int
    width_px: int
    height_px: int
    layout: Literal["yolo", "coco"]
    held_out: float
    seed: int
    excavator_mesh: Path | None = None
    mesh_share: float = 1 / 3
    cast: CastName = "random"

    def __post_init__(self) -> None:
        check_seed(self.seed)
        check_size(self.width_px, self.height_px)

    @property
    def scenes(self) -> int:
        """Return how many scenes it takes."""
        return -(-self.images // self.per_scene)

    def split_of(self, scene: int) -> Split:
        """Return the split of a scene; one scene alone is all train."""
        return draw_split([self.seed, 15485863], scene, self.scenes, self.held_out)


def record_dataset(
    plan: DatasetPlan,
    out: Path,
    *,
    overwrite: bool = False,
    processes: int = 2,
    on_picture: Callable[[], None] | None = None,
) -> None:
    """Render the pictures and write them with their labels.

    Args:
        plan: What to render.
        out: The folder; appears when all is done.
        overwrite: Replace an existing folder.
        processes: That render side by side.
        on_picture: Called after each picture.

    Raises:
        OutputError: The folder cannot be used.
        MissingDependency: No OpenGL.
    """
    with whole_folder(out, overwrite=overwrite, own=SET_FILES) as folder:
        pictures = PictureSet(folder, plan.layout)
        jobs = range(plan.scenes)
        scenes = work_through(partial(open_scene_shooter, plan), jobs, processes=min(processes, len(jobs)))
        with closing(scenes):
            for scene, shot in enumerate(scenes):
                for picture in shot:
                    pictures.add(plan.split_of(scene), picture)
                    if on_picture is not None:
                        on_picture()
        pictures.finish(f"standoff simulated sites, seed {plan.seed}", {**asdict(plan), "scenes": plan.scenes})


@contextmanager
def open_scene_shooter(plan: DatasetPlan) -> Generator[Callable[[int], list[LabelledImage]], None, None]:
    """Give a function from a scene's index to its pictures."""
    studio: Studio | None = None

    def shoot(scene: int) -> list[LabelledImage]:
        nonlocal studio
        rng = np.random.default_rng([plan.seed, 49979687, scene])
        site = build_site(_draw_plan(rng, plan))
        site = replace(site, scene=_thin_street(rng, site.scene))
        obstacles = Obstacles.of(site.scene.props)
        if studio is None:
            studio = Studio(site)
        pictures = []
        for index in range(min(plan.per_scene, plan.images - scene * plan.per_scene)):
            jpeg, entities, view = _shoot(studio, site, obstacles, rng, index)
            name = f"{plan.seed}-{scene:05d}-{index:02d}.jpg"
            size_px = plan.width_px, plan.height_px
            pictures.append(LabelledImage(name, jpeg, size_px, entities, about={"scene": scene}, view=view))
        return pictures

    try:
        yield shoot
    finally:
        if studio is not None:
            studio.close()


def _draw_plan(rng: np.random.Generator, plan: DatasetPlan) -> Plan:
    """Draw a site of any kind, as busy or empty as sites are."""
    shape = rng.choice(["square_footing", "quadrilateral_footing", "painted_square", "none"], p=[0.4, 0.25, 0.15, 0.2])
    covers = (CoverPlan(str(rng.choice(sorted(COVER_KINDS))), -1.0, 2.0),) if rng.random() < 0.3 else ()
    conditions = get_args(Condition)
    preset = Preset(
        "one scene of a data set",
        plan.cast,
        width_px=plan.width_px,
        height_px=plan.height_px,
        frames=_SCENE_FRAMES,
        altitude_m=float(rng.uniform(25.0, 45.0)),
        shape=None if shape == "none" else str(shape),
        covers=() if shape == "none" else covers,
        style=str(rng.choice(list(SiteStyle))),
        condition=conditions[int(rng.choice(len(conditions), p=_CONDITION_SHARES))],
        clutter=float(rng.uniform(0.3, 1.6)),
        furnished_m=40.0,
        reference_offset_m=(float(rng.normal(0.0, 6.0)), float(rng.normal(0.0, 6.0))),
    )
    mesh = plan.excavator_mesh if rng.random() < plan.mesh_share else None
    return Plan("dataset", preset, int(rng.integers(MAX_SEED)), excavator_mesh=mesh)


def _thin_street(rng: np.random.Generator, scene: Scene) -> Scene:
    """Keep some of the parked vehicles: streets full of them would be most of what a detector learns from."""
    share = rng.uniform(0.0, 0.5) ** 2
    gone = {id(vehicle) for vehicle in scene.parked if rng.random() > share}
    props = tuple(batch for batch in scene.props if id(batch) not in gone)
    return replace(scene, props=props, parked=tuple(batch for batch in scene.parked if id(batch) not in gone))


def _shoot(
    studio: Studio, site: Site, obstacles: Obstacles, rng: np.random.Generator, index: int
) -> tuple[bytes, list[Row], View]:
    """Return one picture as JPEG, who is marked in it, and where it was taken from."""
    time_s = float(rng.uniform(0.0, site.duration_s))
    size_px = (site.camera.width_px, site.camera.height_px)
    view = draw_view(rng, size_px, scene_at(site.scene, time_s).bodies, obstacles)
    shutter_s = float(rng.choice(_SHUTTERS_S))
    scene = replace(site.scene, flight=draw_flight(rng, view, time_s))
    studio.show(replace(site, scene=scene, look=_vary(rng, site.look), shutter_s=max(site.shutter_s, shutter_s)))
    shot = studio.shoot(index, time_s)
    quality = int(rng.choice([50, 65, 75, 85, 92, 95]))
    coded, jpeg = cv2.imencode(".jpg", shot.image, [cv2.IMWRITE_JPEG_QUALITY, quality])
    assert coded
    return jpeg.tobytes(), [row for row in shot.entities if is_marked(row)], view


def _vary(rng: np.random.Generator, look: Look) -> Look:
    """Develop one picture of a scene otherwise than the next: exposure, tone, colour, glare."""
    red, green, blue = look.white_balance
    warmth = rng.normal(0.0, 0.03)
    return replace(
        look,
        exposure=look.exposure * float(2.0 ** np.clip(rng.normal(0.0, 0.3), -0.6, 0.6)),
        contrast=look.contrast * float(rng.uniform(0.9, 1.2)),
        lift=look.lift + float(min(rng.exponential(0.003), 0.03)),
        saturation=look.saturation * float(rng.uniform(0.85, 1.25)),
        white_balance=(red * float(1.0 + warmth), green * float(rng.normal(1.0, 0.008)), blue * float(1.0 - warmth)),
    )
