"""The ground on the GPU: its grid in tiles that can be culled, its pictures, and what goes on outside it."""

from __future__ import annotations

from typing import Any, Protocol

import cv2
import numpy as np
import numpy.typing as npt

from standoff.core.homography import FloatArray
from standoff_sim.scene.scene import GroundSurface
from standoff_sim.solids.mesh import Float32Array

_TILE_CELLS = 32
_BEYOND_M = 2500.0
_LUMA = np.array([0.21, 0.72, 0.07])


class Culler(Protocol):
    """Who can tell which bounding spheres matter: a camera's frustum, the sun's box."""

    def sees(self, centre_m: Float32Array, radius_m: Float32Array) -> npt.NDArray[np.bool_]:
        """Return (N,) which spheres may be seen."""
        ...


def grid_vertices(ground: GroundSurface) -> Float32Array:
    """Return (ny + 2, nx + 2, 3) positions; the outer ring lies far outside at the border's height."""
    rows, columns = ground.height_m.shape
    x = ground.origin_xy_m[0] + ground.cell_m * np.arange(columns)
    y = ground.origin_xy_m[1] + ground.cell_m * np.arange(rows)
    x = np.concatenate([[x[0] - _BEYOND_M], x, [x[-1] + _BEYOND_M]])
    y = np.concatenate([[y[0] - _BEYOND_M], y, [y[-1] + _BEYOND_M]])
    table = np.empty((rows + 2, columns + 2, 3), np.float32)
    table[..., 0], table[..., 1] = np.meshgrid(x, y)
    table[..., 2] = np.pad(ground.height_m, 1, mode="edge")
    return table


def slope_picture(ground: GroundSurface) -> npt.NDArray[np.float16]:
    """Return (ny, nx, 2) slopes towards east and north at the height samples."""
    north, east = np.gradient(ground.height_m, ground.cell_m)
    slopes: npt.NDArray[np.float16] = np.stack([east, north], axis=-1).astype(np.float16)
    return slopes


def grid_triangles(rows: int, columns: int) -> tuple[npt.NDArray[np.uint32], npt.NDArray[np.int64]]:
    """Split every cell of a grid from south-west to north-east.

    Returns:
        (C, 6) corners of the two triangles of each cell, counter-clockwise from above, tile by tile, and (K,) the
        number of the first cell of each tile.
    """
    row, column = (index.ravel() for index in np.mgrid[: rows - 1, : columns - 1])
    tile = row // _TILE_CELLS * columns + column // _TILE_CELLS
    order = np.argsort(tile, kind="stable")
    south_west = (row * columns + column)[order]
    south_east, north_west, north_east = south_west + 1, south_west + columns, south_west + columns + 1
    corners = np.stack([south_west, south_east, north_east, south_west, north_east, north_west], axis=1)
    return corners.astype(np.uint32), np.flatnonzero(np.diff(tile[order], prepend=-1))


def encoded_picture(ground: GroundSurface) -> npt.NDArray[np.uint8]:
    """Return (h, w, 4): the square root of linear albedo, which is cheap to decode, and wetness."""
    code = np.arange(256) / 255.0
    linear = np.where(code <= 0.04045, code / 12.92, ((code + 0.055) / 1.055) ** 2.4)
    table = np.round(255.0 * np.sqrt(linear)).astype(np.uint8)
    colour = cv2.LUT(np.ascontiguousarray(ground.albedo), table)
    height, width = colour.shape[:2]
    wetness = ground.wetness
    if wetness.shape != (height, width):
        wetness = cv2.resize(wetness, (width, height), interpolation=cv2.INTER_LINEAR)
    picture: npt.NDArray[np.uint8] = np.dstack([colour, wetness])
    return picture


def upload_with_mipmaps(context: Any, picture: npt.NDArray[np.uint8], *, smooth: bool = True) -> Any:  # noqa: ANN401
    """Return a mipmapped texture; the levels are averaged here, which is quicker than in the driver.

    Args:
        context: OpenGL context.
        picture: (H, W, 4).
        smooth: Blend two levels, at twice the cost.
    """
    texture = context.texture((picture.shape[1], picture.shape[0]), 4, alignment=1)
    texture.build_mipmaps()
    level = 0
    while True:
        texture.write(np.ascontiguousarray(picture).tobytes(), level=level)
        if max(picture.shape[:2]) == 1:
            break
        smaller = max(picture.shape[1] // 2, 1), max(picture.shape[0] // 2, 1)
        picture = cv2.resize(picture, smaller, interpolation=cv2.INTER_AREA)
        level += 1
    texture.filter = (context.LINEAR_MIPMAP_LINEAR if smooth else context.LINEAR_MIPMAP_NEAREST, context.LINEAR)
    return texture


class GroundBuffers:
    """The ground of one scene in GPU memory."""

    def __init__(self, context: Any, ground: GroundSurface) -> None:  # noqa: ANN401
        vertices = grid_vertices(ground)
        corners, starts = grid_triangles(*vertices.shape[:2])
        self._commands = np.zeros((len(starts), 5), np.uint32)
        self._commands[:, 0] = 6 * np.diff(starts, append=len(corners))
        self._commands[:, 1] = 1
        self._commands[:, 2] = 6 * starts
        cell_points = vertices.reshape(-1, 3)[corners[:, [0, 2, 1, 5]]]
        low = np.minimum.reduceat(cell_points.min(axis=1), starts)
        high = np.maximum.reduceat(cell_points.max(axis=1), starts)
        self._centre_m = ((low + high) / 2).astype(np.float32)
        self._radius_m = np.linalg.norm(high - low, axis=1).astype(np.float32) / 2
        self.lowest_m, self.highest_m = float(ground.height_m.min()), float(ground.height_m.max())
        self.vertices = context.buffer(vertices.tobytes())
        self.indices = context.buffer(corners.tobytes())
        self._indirect = context.buffer(reserve=self._commands.nbytes)
        self.picture = upload_with_mipmaps(context, encoded_picture(ground))
        samples = np.array(ground.height_m.shape[::-1])
        size_px = (int(samples[0]), int(samples[1]))
        self.slopes = context.texture(size_px, 2, slope_picture(ground).tobytes(), dtype="f2", alignment=1)
        self.slopes.repeat_x = self.slopes.repeat_y = False
        extent_m = (samples - 1) * ground.cell_m
        self.uniforms = {
            "extent": (*np.asarray(ground.origin_xy_m, dtype=float).tolist(), *extent_m.tolist()),
            "samples": tuple(samples.tolist()),
            "dust_colour": tuple(self._dust_colour(ground).tolist()),
        }
        self._arrays: dict[int, Any] = {}
        self._context = context

    @staticmethod
    def _dust_colour(ground: GroundSurface) -> FloatArray:
        """Dust is the soil's colour, dry: a little lighter and greyer than what lies on the ground."""
        mean = (np.asarray(ground.albedo[::8, ::8], dtype=np.float64) / 255.0).reshape(-1, 3).mean(axis=0) ** 2.2
        dust: FloatArray = np.clip(1.25 * (0.8 * mean + 0.2 * (mean @ _LUMA)) + 0.02, 0.0, 0.6)
        return dust

    def draw(self, program: Any, seen_by: Culler) -> None:  # noqa: ANN401
        """Draw the tiles that a camera or the sun can see."""
        chosen = self._commands[seen_by.sees(self._centre_m, self._radius_m)]
        if not len(chosen):
            return
        if program.glo not in self._arrays:
            self._arrays[program.glo] = self._context.vertex_array(
                program, [(self.vertices, "3f", "position")], self.indices
            )
        self._indirect.write(np.ascontiguousarray(chosen).data)
        self._arrays[program.glo].render_indirect(self._indirect, count=len(chosen))

    def release(self) -> None:
        """Free the GPU memory."""
        for resource in (
            *self._arrays.values(),
            self.vertices,
            self.indices,
            self._indirect,
            self.picture,
            self.slopes,
        ):
            resource.release()
