"""One picture of a scene: the passes in order."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from types import TracebackType
from typing import Self

import numpy as np
import numpy.typing as npt

from standoff.core.pose import View
from standoff_sim.render.colour import ColourPass, sun_uniforms
from standoff_sim.render.context import open_context
from standoff_sim.render.development import Development
from standoff_sim.render.frustum import Frustum
from standoff_sim.render.geometry import Arena, Instances
from standoff_sim.render.ground_buffers import GroundBuffers
from standoff_sim.render.ids import IdPass
from standoff_sim.render.look import Look
from standoff_sim.render.openness import OpennessPass
from standoff_sim.render.shadow import ShadowMap
from standoff_sim.render.targets import Targets
from standoff_sim.scene.scene import Batch, GroundSurface, Light


@dataclass(frozen=True, slots=True, eq=False)
class Rendered:
    """One picture, as the lens shows it.

    Attributes:
        image: (H, W, 3) uint8 BGR, free of noise.
        ids: (H, W) uint16 entity id of what each pixel's centre shows; NOTHING for ground, sky and props.
    """

    image: npt.NDArray[np.uint8]
    ids: npt.NDArray[np.uint16]


@dataclass(frozen=True, slots=True, eq=False)
class Cutout:
    """Things and their shadows without the ground, to be laid over a photograph.

    Attributes:
        light: (H, W, 4) linear red, green, blue and alpha: what lies below shows through by 1 - alpha, and the colours
            are to be added. Alpha is 1 on things, and in their shadows the share of light that they take from level
            ground; edges are smooth.
        ids: (H, W) uint16 as in `Rendered`.
    """

    light: npt.NDArray[np.float32]
    ids: npt.NDArray[np.uint16]


class Renderer:
    """Draws one scene after another.

    A context manager; it owns its OpenGL context, so several can live side by side.

    Args:
        size_px: Width and height of all pictures.
        samples: Per pixel, for smooth edges.

    Raises:
        MissingDependency: moderngl, the EGL library or a driver is not installed.
    """

    def __init__(self, size_px: tuple[int, int], samples: int = 4) -> None:
        self._samples = samples
        self._context = open_context()
        with self._context:
            self._prepare(size_px)

    def _prepare(self, size_px: tuple[int, int]) -> None:
        # Row 0 of every picture is at its top, which turns counter-clockwise triangles round.
        self._context.front_face = "cw"
        self._arena = Arena(self._context)
        self._shadow = ShadowMap(self._context, size_px)
        self._ids = IdPass(self._context)
        self._openness = OpennessPass(self._context)
        self._colour = ColourPass(self._context)
        self._development = Development(self._context, size_px)
        self._targets: Targets | None = None
        self._relief: GroundBuffers | None = None
        self._static = Instances.of((), self._arena)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.release()

    def release(self) -> None:
        """Free everything; the renderer cannot be used any more."""
        self._context.release()

    def load(self, ground: GroundSurface, props: Sequence[Batch]) -> None:
        """Upload a scene in place of the last one; meshes that were uploaded before are not sent again."""
        with self._context:
            if self._relief is not None:
                self._relief.release()
            self._arena.forget_if_large()
            self._relief = GroundBuffers(self._context, ground)
            self._static = Instances.of(props, self._arena)

    def render(self, view: View, batches: Sequence[Batch], light: Light, look: Look) -> Rendered:
        """Draw the loaded scene.

        Args:
            view: Its camera has the renderer's size; its lens shapes both picture and ids.
            batches: What moves, where it is now.
            light: Sun, sky, haze.
            look: Exposure, tone and motion blur.
        """
        if self._relief is None:
            raise RuntimeError("load a scene before rendering")
        with self._context:
            targets, frustum = self._draw(view, batches, light, self._relief)
            return Rendered(*self._development.develop(targets, frustum, look))

    def cut_out(self, view: View, batches: Sequence[Batch], light: Light) -> Cutout:
        """Draw the loaded scene without ground and sky; the ground only takes shadows.

        Args:
            view: Its camera has the renderer's size and a lens without distortion.
            batches: What moves, where it is now.
            light: Sun, sky, haze.
        """
        if self._relief is None or view.camera.bends:
            raise ValueError("load a scene first, and take a camera without distortion")
        with self._context:
            targets, frustum = self._draw(view, batches, light, self._relief, cut_out=True)
            width, height = targets.size_px
            colour = np.frombuffer(targets.resolved.read(components=4, dtype="f2"), np.float16)
            ids = np.frombuffer(targets.id_pass.read(components=1, dtype="u2", alignment=1), np.uint16)
        left, top = (-origin for origin in frustum.origin_px)
        shown = np.s_[top : top + view.camera.height_px, left : left + view.camera.width_px]
        return Cutout(
            colour.reshape(height, width, 4)[shown].astype(np.float32), ids.reshape(height, width)[shown].copy()
        )

    def silhouette_px(self, view: View, batches: Sequence[Batch]) -> int:
        """Count the pixels that the batches alone would cover, nothing in front of them.

        Pixels outside the picture count too, up to one picture's size away from it; what is behind the camera or
        outside what the lens model describes does not.
        """
        with self._context:
            return self._ids.count_silhouette(view, batches, self._arena)

    def _draw(
        self, view: View, batches: Sequence[Batch], light: Light, relief: GroundBuffers, *, cut_out: bool = False
    ) -> tuple[Targets, Frustum]:
        lens_map = self._development.lens_map(view.camera)
        frustum = Frustum(view, lens_map.origin_px, lens_map.size_px)
        targets = self._targets_of(lens_map.size_px)
        everything = self._static + Instances.of(batches, self._arena)
        box = self._shadow.draw(light, frustum, everything, self._arena, relief)
        visible = frustum.visible(everything)
        targets.id_pass.use()
        targets.id_pass.clear(depth=1.0)
        self._ids.draw(frustum, visible, self._arena, relief)
        self._openness.draw(targets, frustum)
        sun = sun_uniforms(light, box, self._shadow, frustum)
        self._colour.draw(targets, frustum, visible, self._arena, relief, self._shadow, sun, cut_out=cut_out)
        return targets, frustum

    def _targets_of(self, size_px: tuple[int, int]) -> Targets:
        if self._targets is None or self._targets.size_px != size_px:
            if self._targets is not None:
                self._targets.release()
            self._targets = Targets(self._context, size_px, self._samples)
        return self._targets
