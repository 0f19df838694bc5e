"""The framebuffers that the passes draw into."""

from __future__ import annotations

from typing import Any

OPENNESS_STEP_PX = 3


class Targets:
    """Everything of one drawn size.

    Args:
        context: OpenGL context.
        size_px: Of the pinhole picture.
        samples: Per pixel of the colour pass.
    """

    def __init__(self, context: Any, size_px: tuple[int, int], samples: int) -> None:  # noqa: ANN401
        self.size_px = size_px
        self.ids = context.texture(size_px, 1, dtype="u2")
        self.ids.filter = (context.NEAREST, context.NEAREST)
        self.depth = context.depth_texture(size_px)
        self.depth.compare_func = ""
        self.depth.filter = (context.NEAREST, context.NEAREST)
        self.id_pass = context.framebuffer([self.ids], self.depth)
        self.ground_depth = context.depth_texture(size_px)
        self.ground_depth.compare_func = ""
        self.ground_depth.filter = (context.NEAREST, context.NEAREST)
        self.ground_depth_pass = context.framebuffer(depth_attachment=self.ground_depth)
        self.ground = context.texture(size_px, 4, dtype="f2")
        self.ground.filter = (context.NEAREST, context.NEAREST)
        self.ground_pass = context.framebuffer([self.ground])
        self.small_px = tuple(-(-length // OPENNESS_STEP_PX) for length in size_px)
        self.rough, self.smooth = (context.texture(self.small_px, 1, dtype="f1") for _ in range(2))
        for texture in (self.rough, self.smooth):
            texture.repeat_x = texture.repeat_y = False
        self.rough_pass, self.smooth_pass = (context.framebuffer([t]) for t in (self.rough, self.smooth))
        self._sampled = context.renderbuffer(size_px, 4, samples=samples, dtype="f2")
        self._sampled_depth = context.depth_renderbuffer(size_px, samples=samples)
        self.colour_pass = context.framebuffer([self._sampled], self._sampled_depth)
        self.colour = context.texture(size_px, 4, dtype="f2")
        self.colour.repeat_x = self.colour.repeat_y = False
        self.resolved = context.framebuffer([self.colour])

    def release(self) -> None:
        """Free the GPU memory."""
        passes = (self.id_pass, self.ground_depth_pass, self.ground_pass, self.rough_pass, self.smooth_pass)
        pictures = (self.ids, self.depth, self.ground_depth, self.ground, self.rough, self.smooth, self.colour)
        sampled = (self.colour_pass, self.resolved, self._sampled, self._sampled_depth)
        for resource in (*passes, *sampled, *pictures):
            resource.release()
