"""The sun's shadow map: fitted to the ground that the camera sees, open towards the sun for tall things outside."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from standoff.core.homography import FloatArray
from standoff.simulation.render.context import build_program, set_uniforms
from standoff.simulation.render.frustum import Frustum
from standoff.simulation.render.geometry import Arena, InstanceDrawer, Instances
from standoff.simulation.render.relief import Relief

SHADOW_SIZE_PX = 4096
_REACH_M = 160.0
_OBJECTS_M = 9.0


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

    def casts(self, instances: Instances) -> Instances:
        """Return the instances that may throw a shadow into the box, larger than half a texel."""
        across = instances.centre_m @ self.axes[:2].T.astype(np.float32)
        radius = instances.radius_m[:, None]
        inside = ((across > self.low_m[:2] - radius) & (across < self.high_m[:2] + radius)).all(axis=1)
        texel_m = float((self.high_m - self.low_m)[:2].max()) / SHADOW_SIZE_PX
        chosen = instances[inside & (instances.radius_m > 0.7 * texel_m)]
        return chosen[np.argsort(chosen.mesh, kind="stable")]


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
    """Depth along the sun's rays, drawn for every picture."""

    def __init__(self, context: Any) -> None:  # noqa: ANN401
        self._context = context
        size = (SHADOW_SIZE_PX, SHADOW_SIZE_PX)
        self.depth = context.depth_texture(size)
        self.depth.compare_func = "<="
        self.depth.repeat_x = self.depth.repeat_y = False
        self._target = context.framebuffer(depth_attachment=self.depth)
        self.compared = context.sampler(texture=self.depth)
        self.compared.filter = (context.LINEAR, context.LINEAR)
        self.compared.compare_func = "<="
        self.compared.repeat_x = self.compared.repeat_y = False
        self.plain = context.sampler(texture=self.depth)
        self.plain.filter = (context.NEAREST, context.NEAREST)
        self.plain.compare_func = ""
        self.plain.repeat_x = self.plain.repeat_y = False
        self._instances = InstanceDrawer(context, build_program(context, ("depth_instances.vert",), ("nothing.frag",)))
        self._ground = build_program(context, ("depth_ground.vert",), ("nothing.frag",))

    def draw(self, box: SunBox, instances: Instances, arena: Arena, relief: Relief) -> None:
        """Draw all casters of a box."""
        # The viewport belongs to the framebuffer in moderngl: use() restores it, nothing else may set it here.
        self._target.use()
        self._target.clear(depth=1.0)
        clip = {"clip_from_offset": box.clip_from_site(), "origin": (0.0, 0.0, 0.0)}
        self._context.polygon_offset = (1.5, 2.0)
        for program in (self._ground, self._instances.program):
            set_uniforms(program, clip)
        self._instances.draw(box.casts(instances), arena)
        relief.draw(self._ground, None)
        self._context.polygon_offset = (0.0, 0.0)
