"""The sun's shadow map: fitted to the ground that the camera sees, open towards the sun for tall things outside."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from standoff.core.homography import FloatArray
from standoff_sim.render.context import build_program, set_uniforms
from standoff_sim.render.frustum import Frustum
from standoff_sim.render.geometry import Arena, InstanceDrawer, Instances
from standoff_sim.render.ground_buffers import GroundBuffers
from standoff_sim.scene.scene import Light

_SMALLEST_PX, _LARGEST_PX = 2048, 4096
_TEXELS_PER_PIXEL = 1.6
_REACH_M = 160.0
_OBJECTS_M = 9.0
_MARGIN_M = 1.0


@dataclass(frozen=True, slots=True, eq=False)
class SunBox:
    """An orthographic view along the sun's rays.

    Attributes:
        axes: (3, 3) rows: across, along, and away from the sun, site frame.
        low_m: (3,) smallest coordinates along the axes.
        high_m: (3,) largest.
    """

    axes: FloatArray
    low_m: FloatArray
    high_m: FloatArray

    def clip_from_site(self) -> FloatArray:
        """Return the (4, 4) matrix from the site to clip space -1..1."""
        size = self.high_m - self.low_m
        matrix = np.eye(4)
        matrix[:3, :3] = 2.0 * self.axes / size[:, None]
        matrix[:3, 3] = -(self.high_m + self.low_m) / size
        return matrix

    def sees(
        self, centre_m: npt.NDArray[np.float32], radius_m: npt.NDArray[np.float32], smallest_m: float = 0.0
    ) -> npt.NDArray[np.bool_]:
        """Return (N,) which spheres may throw a shadow into the box and are larger than a radius."""
        across = centre_m @ self.axes[:2].T.astype(np.float32)
        reach = radius_m[:, None]
        inside = ((across > self.low_m[:2] - reach) & (across < self.high_m[:2] + reach)).all(axis=1)
        seen: npt.NDArray[np.bool_] = inside & (radius_m > smallest_m)
        return seen

    def casters(self, instances: Instances, size_px: int) -> Instances:
        """Return the instances that may throw a shadow wider than a texel into the box, equal kinds together."""
        texel_m = float((self.high_m - self.low_m)[:2].max()) / size_px
        chosen = instances[self.sees(instances.centre_m, instances.radius_m, 0.7 * texel_m)]
        return chosen[np.argsort(chosen.kind, kind="stable")]


def seen_points(frustum: Frustum, lowest_m: float, highest_m: float) -> FloatArray:
    """Return (N, 3) points around all that the camera sees between two heights, not farther than some 160 m."""
    eye, rays = frustum.view.position_m, frustum.rays(7)
    points = []
    for height_m in (lowest_m, highest_m):
        with np.errstate(divide="ignore"):
            reach = (height_m - eye[2]) / rays[:, 2]
        limit = _REACH_M / np.linalg.norm(rays, axis=1)
        reach = np.where((reach > 0) & (reach < limit), reach, limit)
        reached = eye + rays * reach[:, None]
        reached[:, 2] = np.clip(reached[:, 2], lowest_m, highest_m)
        points.append(reached)
    return np.concatenate(points)


def fit_box(to_sun: FloatArray, points_m: FloatArray, casters: Instances, margin_m: float) -> SunBox:
    """Turn and size the box around points, deep enough for everything that can shade them."""
    away = -np.asarray(to_sun, dtype=np.float64)
    first = np.cross(away, [0.0, 0.0, 1.0] if abs(away[2]) < 0.99 else [1.0, 0.0, 0.0])
    first /= np.linalg.norm(first)
    second = np.cross(away, first)
    flat = np.stack([points_m @ first, points_m @ second], axis=1)
    (_, _), (_, _), turn_deg = cv2.minAreaRect(flat.astype(np.float32))
    cosine, sine = np.cos(np.deg2rad(turn_deg)), np.sin(np.deg2rad(turn_deg))
    axes = np.stack([cosine * first + sine * second, cosine * second - sine * first, away])
    local = points_m @ axes.T
    low, high = local.min(axis=0) - margin_m, local.max(axis=0) + margin_m
    if len(casters):
        low[2] = min(low[2], float((casters.centre_m @ away.astype(np.float32) - casters.radius_m).min()) - 1.0)
    # Hills nearer to the sun than all that is seen.
    low[2] -= 100.0
    high[2] += 5.0
    return SunBox(axes, low, high)


class ShadowMap:
    """Depth along the sun's rays, drawn for every picture.

    Attributes:
        size_px: Side of the square map.
    """

    def __init__(self, context: Any, picture_px: tuple[int, int]) -> None:  # noqa: ANN401
        self._context = context
        self.size_px = int(np.clip(_TEXELS_PER_PIXEL * max(picture_px), _SMALLEST_PX, _LARGEST_PX))
        self._depth = context.depth_texture((self.size_px, self.size_px))
        self._target = context.framebuffer(depth_attachment=self._depth)
        self._compared = self._sampler("<=", context.LINEAR)
        self._plain = self._sampler("", context.NEAREST)
        self._things = InstanceDrawer(context, build_program(context, ("depth_instances.vert",), ("nothing.frag",)))
        self._ground = build_program(context, ("depth_ground.vert",), ("nothing.frag",))

    def _sampler(self, comparison: str, smoothness: int) -> Any:  # noqa: ANN401
        sampler = self._context.sampler(texture=self._depth)
        sampler.filter = (smoothness, smoothness)
        sampler.compare_func = comparison
        sampler.repeat_x = sampler.repeat_y = False
        return sampler

    def use(self, compared_unit: int, plain_unit: int) -> None:
        """Bind the map twice: once for comparison, once for its depths."""
        self._compared.use(compared_unit)
        self._plain.use(plain_unit)

    def unuse(self, compared_unit: int, plain_unit: int) -> None:
        """Unbind the samplers, which would otherwise rule over the textures of later passes."""
        self._compared.clear(compared_unit)
        self._plain.clear(plain_unit)

    def draw(self, light: Light, frustum: Frustum, instances: Instances, arena: Arena, relief: GroundBuffers) -> SunBox:
        """Draw everything that can shade what the camera sees."""
        points = seen_points(frustum, relief.lowest_m, relief.highest_m + _OBJECTS_M)
        box = fit_box(light.to_sun, points, instances, _MARGIN_M)
        # The viewport belongs to the framebuffer: setting it on the context here would draw no shadow at all.
        self._target.use()
        self._target.clear(depth=1.0)
        self._context.enable_only(self._context.DEPTH_TEST)
        self._context.polygon_offset = (1.5, 2.0)
        for program in (self._ground, self._things.program):
            set_uniforms(program, {"clip_from_offset": box.clip_from_site(), "origin": (0.0, 0.0, 0.0)})
        self._things.draw(box.casters(instances, self.size_px), arena)
        relief.draw(self._ground, box)
        self._context.polygon_offset = (0.0, 0.0)
        return box
