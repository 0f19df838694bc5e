"""Whether a map's metres are metres: known sizes seen through it, and what a wrong unit looks like."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from standoff.core.camera import CameraPrior
from standoff.core.classes import CLASSES, Role, SiteClass
from standoff.core.homography import BoolArray, FloatArray
from standoff.core.pose import View, view_from_homography
from standoff.core.types import GroundMap, IntArray
from standoff.stages.ground.size_fit import BODY_M, STATURE_M
from standoff.stages.ground.upright_body import log_sizes

WARNING_FACTOR = 1.6
"""Sizes this many times too large or too small are worth a warning: no crew and no fleet is."""

REFUSAL_FACTOR = 4.0
"""Sizes this many times too large or too small mean that the map is wrong."""

CLASS_SIGMA = {"worker": 0.045, "excavator": 0.30, "wheel_loader": 0.20, "dump_truck": 0.20, "roller_or_dozer": 0.30}
"""Standard error of the log of the mean size of a site's machines of a class, or of its crew, with loose boxes."""

_OTHER_CLASS_SIGMA = 0.12
_FILL = {"excavator": 0.8}
_OTHER_FILL = 0.9
"""A machine's box is smaller than its block's: corners are rounded off, and a boom is seldom stretched out."""

_ENTITY_SIGMA = {Role.PERSON: 0.10, Role.EQUIPMENT: 0.20}
"""Standard error of the log size of one entity against its class: by posture and stature, or by heading and kind."""

_LOOSE_PX = 1.5
"""How many pixels too large or too small a detector's boxes are."""

_TALLER_AT = 0.7
"""Who looks small may stoop or be half hidden; the size that people have is this quantile of what they show."""

_EDGE_PX = 2.0

_FISHEYE_UPRIGHT_RAD = np.deg2rad(30.0)
"""So far off a fisheye's axis a person's box is within 14 % of what it should be; at 50 degrees it misses by half."""

_REFINEMENTS = 6

_CORNERS = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (0.0, 1.0)])
"""(8, 3) of a block of sides 1 that stands on the origin."""

_ANGLES = np.deg2rad(np.arange(7.5, 180.0, 15.0))
_TURNS = np.array([[[np.cos(a), np.sin(a), 0.0], [-np.sin(a), np.cos(a), 0.0], [0.0, 0.0, 1.0]] for a in _ANGLES])
"""(12, 3, 3) headings of a machine, half around: the other half looks the same."""

_UNITS = {
    "millimetres for metres": 1000.0,
    "centimetres for metres": 100.0,
    "inches for metres": 39.37,
    "feet for metres": 3.281,
    "metres for feet": 0.3048,
    "metres for inches": 0.0254,
    "metres for centimetres": 0.01,
    "kilometres for metres": 0.001,
}
_UNIT_TOLERANCE = 1.3


@dataclass(frozen=True, slots=True)
class SizeScale:
    """How large known things look through a map.

    Attributes:
        ratio: Apparent to expected size: 1 is right, at 2 the map's metres are twice too large.
        sigma: Standard error of the ratio's logarithm, with what all of a crew or a class share.
        entities: How many people and machines it rests on.
    """

    ratio: float
    sigma: float
    entities: int

    @property
    def verdict(self) -> Literal["agrees", "warning", "refusal"]:
        """What to do with the map; nothing worse than "agrees" unless the sizes are sure of it (two sigma)."""
        off = abs(float(np.log(self.ratio)))
        if off < 2.0 * self.sigma or off < np.log(WARNING_FACTOR):
            return "agrees"
        return "refusal" if off >= np.log(REFUSAL_FACTOR) else "warning"


def unit_hint(ratio: float) -> str | None:
    """Name the mistaken unit that makes sizes look so much too large, or None where no usual one does.

    Args:
        ratio: Apparent to expected size, above 0.

    >>> unit_hint(95.0), unit_hint(3.4), unit_hint(1.1)
    ('centimetres for metres', 'feet for metres', None)
    """
    off = {unit: abs(float(np.log(ratio / factor))) for unit, factor in _UNITS.items()}
    nearest = min(off, key=lambda unit: off[unit])
    return nearest if off[nearest] < np.log(_UNIT_TOLERANCE) else None


def scale_from_sizes(
    ground: GroundMap | View,
    xyxy_px: FloatArray,
    class_id: IntArray,
    entity_id: IntArray | None = None,
    camera: CameraPrior | None = None,
) -> SizeScale | None:
    """Compare the sizes of people and machines with what they should be, seen through a map of the ground.

    Boxes that touch the picture's edge, or stand where the map sees no ground, are left out. Give only boxes that a
    detector is sure of: clutter that it takes for people is smaller than people.

    Args:
        ground: The map; of a `GroundMap` the camera's pose is derived.
        xyxy_px: (N, 4) boxes as seen in the picture.
        class_id: (N,) ids of `CLASSES`.
        entity_id: (N,) the same number for boxes of the same entity; None: each box is another one.
        camera: The lens, where the map knows none; None: any drone's.

    Returns:
        None where nothing of known size is seen whole.

    Raises:
        GroundError: The map is not one that a camera above the ground could have.
    """
    view, lens_sigma = _view_of(ground, camera)
    xyxy_px = np.asarray(xyxy_px, dtype=np.float64).reshape(-1, 4)
    entity_id = np.arange(len(xyxy_px)) if entity_id is None else entity_id
    usable = _seen_whole(view, xyxy_px) & np.isin(class_id, [kind.id for kind in CLASSES if kind.height_m > 0])
    logs: list[float] = []
    variances: list[float] = []
    entities = 0
    for kind in CLASSES:
        mine = usable & (class_id == kind.id)
        if not mine.any():
            continue
        log_ratio = _log_ratios(view, xyxy_px[mine], kind)
        if not np.isfinite(log_ratio).any():
            continue
        people = kind.role is Role.PERSON
        each = _per_entity(log_ratio, entity_id[mine], _TALLER_AT if people else 0.5)
        spread, size_px = _ENTITY_SIGMA[kind.role], float(np.median(np.diff(xyxy_px[mine][:, [1, 3]])))
        # Of fewer than three people nobody knows whether they stand up straight: the middle is all there is.
        logs.append(float(np.quantile(each, _TALLER_AT if people and len(each) > 2 else 0.5)))
        shared = CLASS_SIGMA.get(kind.name, _OTHER_CLASS_SIGMA)
        variances.append(shared**2 + spread**2 / len(each) + (_LOOSE_PX / size_px) ** 2)
        entities += len(each)
    if not logs:
        return None
    weight = 1.0 / np.array(variances)
    mean = float(weight @ np.array(logs) / weight.sum())
    return SizeScale(float(np.exp(mean)), float(np.hypot(1.0 / np.sqrt(weight.sum()), lens_sigma)), entities)


def size_ratios(
    ground: GroundMap | View, xyxy_px: FloatArray, class_id: IntArray, camera: CameraPrior | None = None
) -> tuple[FloatArray, FloatArray]:
    """Compare each box by itself, as `scale_from_sizes` does all together.

    Args:
        ground: The map; of a `GroundMap` the camera's pose is derived.
        xyxy_px: (N, 4) boxes as seen in the picture.
        class_id: (N,) ids of `CLASSES`.
        camera: The lens, where the map knows none; None: any drone's.

    Returns:
        (N,) logarithms of apparent to expected size, NaN where nothing can be said, and (N,) their standard errors.

    Raises:
        GroundError: The map is not one that a camera above the ground could have.
    """
    view, lens_sigma = _view_of(ground, camera)
    log_ratio, variance = np.full(len(xyxy_px), np.nan), np.full(len(xyxy_px), lens_sigma**2)
    usable = _seen_whole(view, xyxy_px)
    for kind in CLASSES:
        mine = usable & (class_id == kind.id) & (kind.height_m > 0)
        if mine.any():
            log_ratio[mine] = _log_ratios(view, xyxy_px[mine], kind)
            shared = CLASS_SIGMA.get(kind.name, _OTHER_CLASS_SIGMA)
            size_px = xyxy_px[mine, 3] - xyxy_px[mine, 1]
            variance[mine] += shared**2 + _ENTITY_SIGMA[kind.role] ** 2 + (_LOOSE_PX / size_px) ** 2
    return log_ratio, np.sqrt(variance)


def _view_of(ground: GroundMap | View, camera: CameraPrior | None) -> tuple[View, float]:
    """Return the camera's pose, and what not knowing its lens adds to the log ratio's standard error."""
    if isinstance(ground, View):
        return ground, 0.0
    if ground.camera is not None:
        return view_from_homography(ground.image_to_ground, ground.camera), 0.0
    prior = camera or CameraPrior.unknown(*ground.image_size_px)
    # The map gives the distances on the ground; only the height of what stands on it leans on the lens.
    return view_from_homography(ground.image_to_ground, prior.camera), prior.focal_sigma


def _seen_whole(view: View, xyxy_px: FloatArray) -> BoolArray:
    far_px = np.array([view.camera.width_px, view.camera.height_px]) - 1.0 - _EDGE_PX
    inside = np.hstack([xyxy_px[:, :2] > _EDGE_PX, xyxy_px[:, 2:] < far_px, xyxy_px[:, 2:] > xyxy_px[:, :2]])
    feet_px = np.column_stack([(xyxy_px[:, 0] + xyxy_px[:, 2]) / 2.0, xyxy_px[:, 3]])
    whole: BoolArray = np.all(np.hstack([inside, np.isfinite(view.to_plane(feet_px))]), axis=1)
    return whole


def _per_entity(log_ratio: FloatArray, entity_id: IntArray, quantile: float) -> FloatArray:
    finite = np.isfinite(log_ratio)
    entities = np.unique(entity_id[finite])
    each = [np.quantile(log_ratio[finite & (entity_id == entity)], quantile) for entity in entities]
    return np.array(each, dtype=np.float64)


def _log_ratios(view: View, xyxy_px: FloatArray, kind: SiteClass) -> FloatArray:
    """Return (N,) log of apparent to expected size."""
    if kind.role is Role.PERSON:
        return np.where(_upright(view, xyxy_px), _person_log_ratios(view, xyxy_px), np.nan)
    fill = float(np.log(_FILL.get(kind.name, _OTHER_FILL)))
    return np.array([_block_log_ratio(view, box, kind) - fill for box in xyxy_px], dtype=np.float64)


def _upright(view: View, xyxy_px: FloatArray) -> BoolArray:
    """Return (N,) where boxes are as high as the people in them look: not far off the axis of a fisheye."""
    if view.camera.lens == "brown":
        return np.ones(len(xyxy_px), dtype=np.bool_)
    middle_px = (xyxy_px[:, :2] + xyxy_px[:, 2:]) / 2.0
    upright: BoolArray = view.rays(middle_px) @ view.site_to_camera[2] > np.cos(_FISHEYE_UPRIGHT_RAD)
    return upright


def _person_log_ratios(view: View, xyxy_px: FloatArray) -> FloatArray:
    """Return (N,) how many times taller than usual people with such boxes are, as logarithms."""
    middle_px = (xyxy_px[:, :2] + xyxy_px[:, 2:]) / 2.0
    top_px, bottom_px = middle_px.copy(), middle_px.copy()
    top_px[:, 1], bottom_px[:, 1] = xyxy_px[:, 1], xyxy_px[:, 3]
    lens = view.camera.matrix
    top, bottom = ((view.camera.undistort(at_px) - lens[:2, 2]) / np.diag(lens)[:2] for at_px in (top_px, bottom_px))
    observed = np.log(np.maximum(bottom[:, 1] - top[:, 1], 1e-9))
    rotation = np.broadcast_to(view.site_to_camera, (1, len(xyxy_px), 3, 3)).copy()
    log_ratio: FloatArray = np.zeros(len(xyxy_px))
    # A person k times as large seen from a height is a person seen from a k-th of it.
    for _ in range(_REFINEMENTS):
        position_m = (view.position_m * np.exp(-log_ratio)[:, None])[None]
        order = np.arange(len(xyxy_px))
        size, _share = log_sizes(rotation, position_m, order, ((top + bottom) / 2.0)[None], STATURE_M, BODY_M)
        log_ratio = log_ratio + observed - size[0, :, 1]
    return log_ratio


def _block_log_ratio(view: View, xyxy_px: FloatArray, kind: SiteClass) -> float:
    """Return how many times larger than a block of its class a machine looks, as a logarithm, over all headings.

    NaN where a block so large would reach behind the camera.
    """
    middle_px = ((xyxy_px[:2] + xyxy_px[2:]) / 2.0)[None]
    observed = float(np.log(xyxy_px[2:] - xyxy_px[:2]).mean())
    log_ratio = 0.0
    for _ in range(_REFINEMENTS):
        factor = np.exp(log_ratio)
        place_m = np.append(view.to_plane(middle_px, factor * kind.height_m / 2.0)[0], 0.0)
        corners_m = place_m + factor * (_CORNERS * [kind.length_m, kind.width_m, kind.height_m]) @ _TURNS
        seen_px = view.project(corners_m.reshape(-1, 3)).reshape(len(_TURNS), len(_CORNERS), 2)
        log_ratio += observed - float(np.log(np.ptp(seen_px, axis=1)).mean())
    return log_ratio
