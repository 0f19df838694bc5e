"""A data set of composites for training: YOLO's layout, split by flight."""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from contextlib import closing, contextmanager
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path

import cv2
import numpy as np
import shapely

from standoff.core.errors import ConfigError
from standoff.core.homography import FloatArray
from standoff.core.pose import View
from standoff.core.types import ImageArray
from standoff.files.whole import whole_folder
from standoff.labels.types import Split
from standoff_sim.camera.flight import Still
from standoff_sim.camera.sensor import Sensor
from standoff_sim.clip.picture_set import SET_FILES, LabelledImage, PictureSet, draw_split, is_marked
from standoff_sim.clip.presets import Condition, check_seed, check_size
from standoff_sim.clip.processes import work_through
from standoff_sim.clip.truth import Row, entity_rows
from standoff_sim.composites.backgrounds import Background, find_backgrounds, split_backgrounds
from standoff_sim.composites.blending import Match, blend
from standoff_sim.composites.company import MOMENT_S, Company, gather
from standoff_sim.composites.framing import Framed, frame
from standoff_sim.composites.plane import Plane
from standoff_sim.ground.soil_colours import PALETTES
from standoff_sim.ground.terrain_plan import Soil
from standoff_sim.render import Cutout, Renderer
from standoff_sim.scene.light import random_light
from standoff_sim.scene.moment import Moment, scene_at
from standoff_sim.scene.scene import Light, Scene

MOST_MACHINES = 30
"""In one picture that may be asked for; beyond, the ground is full."""
_UNTOUCHED_SHARE, _DESERTED_SHARE = 0.05, 0.10
_SMEARED_SHARE, _LONGEST_SMEAR_PX = 0.2, 6.0
_QUALITIES = (50, 65, 75, 85, 92, 95)
_SOILS = tuple(soil for soil in Soil if soil in PALETTES)
_DUST_TONES = (110, 190)
_HIDDEN = 0.6
"""Of a marked vehicle of the photograph under clutter, and nobody would mark it any more."""
_ALONE_M = 0.4


@dataclass(frozen=True, slots=True)
class CompositePlan:
    """What to make.

    Attributes:
        backgrounds: Sources of photographs, see `backgrounds.find_backgrounds`.
        images: How many in all.
        width_px: Of the pictures.
        height_px: Of the pictures.
        held_out: Share of flights and of pictures for each of val and test.
        seed: Of everything random.
        excavator_mesh: Folder of mesh parts for a third of the excavators, or None.
        most_machines: In a picture; many teach where a machine stands, whichever way it is turned.

    Raises:
        ConfigError: A size, seed or number of machines out of range.
    """

    backgrounds: tuple[str, ...]
    images: int
    width_px: int
    height_px: int
    held_out: float
    seed: int
    excavator_mesh: Path | None = None
    most_machines: int = 4

    def __post_init__(self) -> None:
        check_seed(self.seed)
        check_size(self.width_px, self.height_px)
        if not 0 <= self.most_machines <= MOST_MACHINES:
            raise ConfigError(
                expected=f"0 to {MOST_MACHINES} machines in a picture", found=str(self.most_machines),
                fix="choose a number in this range",
            )  # fmt: skip

    def split_of(self, index: int, splits: dict[Split, tuple[Background, ...]]) -> Split:
        """Return the split of a picture; without flights that are held out all pictures are for training."""
        split = draw_split([self.seed, 32452843], index, self.images, self.held_out)
        return split if splits[split] else "train"


def record_composites(
    plan: CompositePlan,
    out: Path,
    *,
    overwrite: bool = False,
    processes: int = 2,
    on_picture: Callable[[], None] | None = None,
) -> None:
    """Make the pictures and write them with their labels.

    Args:
        plan: What to make.
        out: The folder; appears when all is done.
        overwrite: Replace an existing folder.
        processes: That work side by side; the result does not depend on it.
        on_picture: Called after each picture.

    Raises:
        DataError: No photographs, or one that cannot be read.
        OutputError: The folder cannot be used.
        MissingDependency: No OpenGL.
    """
    splits = split_backgrounds(find_backgrounds(plan.backgrounds), plan.held_out)
    with whole_folder(out, overwrite=overwrite, own=SET_FILES) as folder:
        pictures = PictureSet(folder, "yolo")
        jobs = range(plan.images)
        made = work_through(partial(open_compositor, plan), jobs, processes=min(processes, len(jobs)))
        with closing(made):
            for index, picture in enumerate(made):
                pictures.add(plan.split_of(index, splits), picture)
                if on_picture is not None:
                    on_picture()
        flights = {split: sorted({b.group for b in backgrounds}) for split, backgrounds in splits.items()}
        pictures.finish("", {**asdict(plan), "flights": flights})


@contextmanager
def open_compositor(plan: CompositePlan) -> Generator[Callable[[int], LabelledImage], None, None]:
    """Give a function from a picture's index to the picture."""
    splits = split_backgrounds(find_backgrounds(plan.backgrounds), plan.held_out)
    size_px = plan.width_px, plan.height_px

    with Renderer(size_px) as renderer:

        def make(index: int) -> LabelledImage:
            rng = np.random.default_rng([plan.seed, 86028121, index])
            background = _choose(rng, splits[plan.split_of(index, splits)])
            framed = frame(rng, background, size_px)
            condition = background.conditions[int(rng.integers(len(background.conditions)))]
            image, rows = _compose(rng, renderer, framed, condition, plan)
            image = _photograph(rng, image, condition)
            jpeg = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, int(rng.choice(_QUALITIES))])[1]
            ignored = [(float(a), float(b), float(c), float(d)) for a, b, c, d in framed.ignored_px]
            name = f"c{plan.seed}-{background.group}-{index:05d}.jpg"
            return LabelledImage(name, jpeg.tobytes(), size_px, rows, ignored, view=framed.view)

        yield make


def _choose(rng: np.random.Generator, backgrounds: Sequence[Background]) -> Background:
    """Draw a photograph; a flight with four times as many is drawn twice as often."""
    groups = [background.group for background in backgrounds]
    weights = np.array([groups.count(group) ** -0.5 for group in groups])
    return backgrounds[int(rng.choice(len(backgrounds), p=weights / weights.sum()))]


def _compose(
    rng: np.random.Generator, renderer: Renderer, framed: Framed, condition: Condition, plan: CompositePlan
) -> tuple[ImageArray, list[Row]]:
    """Return the picture before the camera's own faults, and what is marked in it."""
    kept = [_marked(box, int(kind)) for box, kind in zip(framed.xyxy_px, framed.class_id, strict=True)]
    chance = rng.random()
    if chance < _UNTOUCHED_SHARE:
        return framed.image, kept
    light = _light(rng, condition, framed.shadow_deg)
    blue, green, red = np.median(framed.image[::8, ::8].reshape(-1, 3), axis=0).tolist()
    palette = PALETTES[_SOILS[int(rng.integers(len(_SOILS)))]]
    ground = Plane((red, green, blue), tuple(palette[int(rng.integers(*_DUST_TONES)), 0].tolist()))
    taken = [_footprint(framed.view, box) for box in framed.xyxy_px]
    deserted = chance < _UNTOUCHED_SHARE + _DESERTED_SHARE
    company = gather(
        rng, framed, taken, ground, plan.excavator_mesh, most_machines=plan.most_machines, deserted=deserted
    )
    moment = scene_at(_scene(company, ground, light, framed.view), MOMENT_S)
    renderer.load(ground, company.props)
    cutout = renderer.cut_out(framed.view, moment.batches, light)
    rows = _rows(renderer, moment, cutout)
    match = Match.draw(rng, framed.image, framed.zoom, light)
    visible = [row for row in kept if _share_hidden(cutout, row) < _HIDDEN]
    return blend(rng, framed.image, cutout, match), visible + rows


def _marked(box_px: FloatArray, class_id: int) -> Row:
    edges = zip(("x1_px", "y1_px", "x2_px", "y2_px"), box_px.tolist(), strict=True)
    return {"class_id": class_id, **dict(edges)}


def _share_hidden(cutout: Cutout, row: Row) -> float:
    left, top, right, bottom = (round(row[name]) for name in ("x1_px", "y1_px", "x2_px", "y2_px"))
    covered = cutout.light[max(top, 0) : bottom + 1, max(left, 0) : right + 1]
    return float((covered[..., :3].max(axis=-1) > 0.0).mean()) if covered.size else 1.0


def _light(rng: np.random.Generator, condition: Condition, shadow_deg: float | None) -> Light:
    """Draw a light whose shadows fall as the photograph's do."""
    light = random_light(rng, condition)
    sunward_rad = np.deg2rad(float(rng.uniform(0.0, 360.0)) if shadow_deg is None else shadow_deg + 180.0)
    level = float(np.hypot(*light.to_sun[:2]))
    to_sun = np.array([level * np.sin(sunward_rad), level * np.cos(sunward_rad), light.to_sun[2]])
    return replace(light, to_sun=to_sun, haze_per_m=0.0)


def _footprint(view: View, box_px: FloatArray) -> shapely.Polygon:
    corners = view.to_plane(box_px[[0, 1, 2, 1, 2, 3, 0, 3]].reshape(4, 2))
    return shapely.Polygon(corners).buffer(_ALONE_M)


def _scene(company: Company, ground: Plane, light: Light, view: View) -> Scene:
    return Scene(
        "composite", 0, ground, tuple(company.props), tuple(company.actors), (), company.reference, light, Still(view)
    )


def _rows(renderer: Renderer, moment: Moment, cutout: Cutout) -> list[Row]:
    rows = entity_rows(0, moment, cutout.ids, lambda body: renderer.silhouette_px(moment.view, body.batches))
    return [row for row in rows if is_marked(row)]


def _photograph(rng: np.random.Generator, image: ImageArray, condition: Condition) -> ImageArray:
    """Take the picture with some camera, now and then with one that moves."""
    if rng.random() < _SMEARED_SHARE:
        image = _smeared(image, float(rng.uniform(1.5, _LONGEST_SMEAR_PX)), float(rng.uniform(0.0, np.pi)))
    return Sensor.draw(rng, condition).expose(image, rng)


def _smeared(image: ImageArray, length_px: float, angle_rad: float) -> ImageArray:
    half = int(np.ceil(length_px / 2)) + 1
    steps = np.linspace(-0.5, 0.5, 33)[:, None] * length_px * np.array([np.cos(angle_rad), np.sin(angle_rad)])
    kernel = np.zeros((2 * half + 1, 2 * half + 1), np.float32)
    for x, y in (np.rint(steps) + half).astype(int).tolist():
        kernel[y, x] += 1.0
    return np.asarray(cv2.filter2D(image, -1, kernel / kernel.sum()), dtype=np.uint8)
