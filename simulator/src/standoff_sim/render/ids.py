"""The id pass: which entity each pixel's centre shows, and how far away it is."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from standoff.core.homography import FloatArray
from standoff.core.pose import View
from standoff_sim.render.context import build_program, set_uniforms
from standoff_sim.render.frustum import Frustum
from standoff_sim.render.geometry import Arena, InstanceDrawer, Instances
from standoff_sim.render.ground_buffers import GroundBuffers
from standoff_sim.render.lens import LensMap
from standoff_sim.scene.scene import Batch

_SMALLEST_PX = 8
_SEEN = 1.0


class IdPass:
    """Draws ids and depth without anti-aliasing, and counts the pixels of silhouettes."""

    def __init__(self, context: Any) -> None:  # noqa: ANN401
        self._context = context
        with_ids = "define_ids.glsl"
        thing = build_program(context, (with_ids, "depth_instances.vert"), ("ids.frag",))
        self._things = InstanceDrawer(context, thing)
        self._ground = build_program(context, (with_ids, "depth_ground.vert"), ("ids.frag",))
        self._silhouette = _IdTarget(context, (256, 256))

    def draw(self, frustum: Frustum, visible: Instances, arena: Arena, relief: GroundBuffers | None) -> None:
        """Draw into the framebuffer in use, which is clear."""
        self._context.enable_only(self._context.DEPTH_TEST)
        placed = {"clip_from_offset": frustum.clip_from_offset(), "origin": tuple(frustum.view.position_m.tolist())}
        for program in (self._things.program, self._ground):
            set_uniforms(program, placed)
        self._things.draw(visible, arena)
        if relief is not None:
            relief.draw(self._ground, frustum)

    def count_silhouette(self, view: View, batches: Sequence[Batch], arena: Arena) -> int:
        """Count the pixels, in and around the picture, whose centres the batches alone would cover."""
        bounds = silhouette_bounds(view, batches)
        if bounds is None:
            return 0
        lens_map = LensMap.of(view.camera, *bounds)
        frustum = Frustum(view, lens_map.origin_px, lens_map.size_px)
        width, height = lens_map.size_px
        old = self._silhouette.size_px
        if width > old[0] or height > old[1]:
            self._silhouette.release()
            self._silhouette = _IdTarget(self._context, (max(width, old[0]), max(height, old[1])))
        target = self._silhouette.target
        target.viewport = (0, 0, width, height)
        target.use()
        target.clear(depth=1.0)
        instances = Instances.of(batches, arena)
        instances.rows[:, 16] = _SEEN
        self.draw(frustum, frustum.visible(instances), arena, None)
        read = target.read(viewport=(0, 0, width, height), components=1, dtype="u2", alignment=1)
        drawn = np.frombuffer(read, np.uint16).reshape(height, width)
        pixel = lens_map.undistorted_px[~np.isnan(lens_map.undistorted_px[..., 0])] - lens_map.origin_px
        column, row = np.floor(pixel + 0.5).astype(np.int64).T
        return int(np.count_nonzero(drawn[row, column]))


class _IdTarget:
    def __init__(self, context: Any, size_px: tuple[int, int]) -> None:  # noqa: ANN401
        self.size_px = size_px
        self._ids = context.texture(size_px, 1, dtype="u2")
        self._depth = context.depth_renderbuffer(size_px)
        self.target = context.framebuffer([self._ids], self._depth)

    def release(self) -> None:
        for resource in (self.target, self._ids, self._depth):
            resource.release()


def silhouette_bounds(view: View, batches: Sequence[Batch]) -> tuple[int, int, int, int] | None:
    """Return left, top, width and height in pixels of a rectangle around the batches, seen through the lens.

    It ends one picture's size outside the picture. None when nothing of them is in front of the camera.
    """
    corners = [_box_corners(batch) for batch in batches if len(batch.poses) and len(batch.mesh.vertices_m)]
    if not corners:
        return None
    points_px = view.project(np.concatenate(corners))
    points_px = points_px[~np.isnan(points_px[:, 0])]
    if not len(points_px):
        return None
    size = np.array([view.camera.width_px, view.camera.height_px])
    low = np.clip(np.floor(points_px.min(axis=0)) - 3, -size, 2 * size)
    high = np.clip(np.ceil(points_px.max(axis=0)) + 3, -size, 2 * size)
    extent = np.maximum(high - low + 1, _SMALLEST_PX)
    return int(low[0]), int(low[1]), int(extent[0]), int(extent[1])


def _box_corners(batch: Batch) -> FloatArray:
    """Return (8 N, 3) corners of the boxes around every instance, site frame."""
    ends = np.stack([batch.mesh.vertices_m.min(axis=0), batch.mesh.vertices_m.max(axis=0)]).astype(np.float64)
    choice = np.stack(np.meshgrid([0, 1], [0, 1], [0, 1]), axis=-1).reshape(-1, 3)
    local = np.column_stack([ends[choice, np.arange(3)], np.ones(8)])
    corners: FloatArray = np.einsum("nij,kj->nki", batch.poses[:, :3], local).reshape(-1, 3)
    return corners
