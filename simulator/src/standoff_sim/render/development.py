"""The last pass: through the lens, exposed and developed to picture values."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from standoff.core.camera import Camera
from standoff.core.homography import FloatArray, apply
from standoff_sim.render.context import build_program, set_uniforms
from standoff_sim.render.frustum import Frustum
from standoff_sim.render.lens import LensMap
from standoff_sim.render.look import Look
from standoff_sim.render.targets import Targets

_MOST_TAPS = 9
_SHARP_PX = 0.25


class Development:
    """Turns the drawn pinhole picture into the camera's picture."""

    def __init__(self, context: Any, size_px: tuple[int, int]) -> None:  # noqa: ANN401
        self._context, self._size_px = context, size_px
        self._pass = context.vertex_array(build_program(context, ("fullscreen.vert",), ("lens.frag",)), [])
        self._colour, self._ids = context.texture(size_px, 4), context.texture(size_px, 1, dtype="u2")
        self._output = context.framebuffer([self._colour, self._ids])
        self._map = context.texture(size_px, 2, dtype="f4")
        self._map.filter = (context.NEAREST, context.NEAREST)
        self._known: tuple[bytes, LensMap] | None = None

    def lens_map(self, camera: Camera) -> LensMap:
        """Return the map of a camera; it is kept until the camera changes."""
        if (camera.width_px, camera.height_px) != self._size_px:
            raise ValueError(f"the camera is for {camera.width_px}x{camera.height_px}, the renderer {self._size_px}")
        key = camera.matrix.tobytes() + camera.distortion.tobytes() + camera.lens.encode()
        if self._known is None or self._known[0] != key:
            lens_map = LensMap.of(camera, 0, 0, *self._size_px)
            drawn_px = (lens_map.undistorted_px - lens_map.origin_px).astype(np.float32)
            self._map.write(np.ascontiguousarray(drawn_px).data)
            self._known = key, lens_map
        return self._known[1]

    def develop(
        self, targets: Targets, frustum: Frustum, look: Look
    ) -> tuple[npt.NDArray[np.uint8], npt.NDArray[np.uint16]]:
        """Return the (H, W, 3) BGR picture and the (H, W) ids for the camera given last to `lens_map`."""
        self._context.enable_only(self._context.NOTHING)
        drawn_from_undistorted = np.linalg.inv(frustum.undistorted_from_drawn())
        blur = np.eye(3) if look.blur is None else look.blur
        gain = look.exposure * np.array(look.white_balance)
        width, height = self._size_px
        values = {
            "drawn": 0,
            "drawn_ids": 1,
            "undistorted": 2,
            "drawn_texel": tuple(1.0 / length for length in targets.size_px),
            "blur": drawn_from_undistorted @ blur @ frustum.undistorted_from_drawn(),
            "blur_taps": blur_taps(blur, frustum),
            "gain": tuple(gain.tolist()),
            "tone": (look.contrast, look.lift, look.saturation, look.vignette),
            "picture_centre": (width / 2, height / 2),
        }
        set_uniforms(self._pass.program, values)
        self._output.use()
        for unit, texture in enumerate((targets.colour, targets.ids, self._map)):
            texture.use(unit)
        self._pass.render(vertices=3)
        colour = np.frombuffer(self._output.read(components=4, alignment=1), np.uint8).reshape(height, width, 4)
        ids = np.frombuffer(self._output.read(components=1, attachment=1, dtype="u2", alignment=1), np.uint16)
        return np.ascontiguousarray(colour[..., :3]), ids.reshape(height, width).copy()


def blur_taps(blur: FloatArray, frustum: Frustum) -> int:
    """Return how many samples along the longest path are less than a pixel and a half apart: 1 to 9.

    Args:
        blur: As in `Look`.
        frustum: The drawn picture, whose corners move most.
    """
    left, top = frustum.origin_px
    width, height = frustum.size_px
    corners = np.array([[left, top], [left + width, top], [left, top + height], [left + width, top + height]], float)
    moved, valid = apply(blur, corners)
    path_px = np.linalg.norm(moved - corners, axis=1)[valid].max(initial=0.0)
    return int(np.clip(np.ceil(path_px / 1.5), 2, _MOST_TAPS)) if path_px > _SHARP_PX else 1
