"""One picture of a scene: the passes in order."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from types import TracebackType
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from standoff.core.pose import View
from standoff.simulation.render.context import build_program, open_context, set_uniforms
from standoff.simulation.render.frustum import FAR_M, NEAR_M, Frustum
from standoff.simulation.render.geometry import Arena, InstanceDrawer, Instances
from standoff.simulation.render.lens import LensMap
from standoff.simulation.render.look import Look
from standoff.simulation.render.noise import make_noise
from standoff.simulation.render.relief import Relief, upload_with_mipmaps
from standoff.simulation.render.shadow import SHADOW_SIZE_PX, ShadowMap, SunBox, fit_box, seen_points
from standoff.simulation.render.surfaces import surface_table
from standoff.simulation.render.targets import OPENNESS_STEP_PX, Targets
from standoff.simulation.scene import Batch, Ground, Light


@dataclass(frozen=True, slots=True, eq=False)
class Rendered:
    """One picture, as the lens shows it.

    Attributes:
        image: (H, W, 3) uint8 BGR, free of noise.
        ids: (H, W) uint16 entity id of what each pixel's centre shows.
    """

    image: npt.NDArray[np.uint8]
    ids: npt.NDArray[np.uint16]


class Renderer:
    """Draws one scene after another; a context manager that owns its OpenGL context."""

    def __init__(self, size_px: tuple[int, int], samples: int = 4) -> None:
        self._size_px, self._samples = size_px, samples
        self._context = open_context()
        self._context.gc_mode = "context_gc"
        self._context.front_face = "cw"
        self._arena = Arena(self._context)
        self._shadow = ShadowMap(self._context)
        lit, ids = "light.glsl", "define_ids.glsl"
        build = self._build
        self._things = InstanceDrawer(self._context, build(("instances.vert",), (lit, "instances.frag")))
        self._thing_ids = InstanceDrawer(self._context, build((ids, "depth_instances.vert"), ("ids.frag",)))
        self._ground = build(("ground.vert",), (lit, "ground.frag"))
        self._ground_ids = build((ids, "depth_ground.vert"), ("ids.frag",))
        self._sky, self._openness, self._smooth, self._lens = (
            self._context.vertex_array(build(("fullscreen.vert",), fragment), [])
            for fragment in ((lit, "sky.frag"), ("openness.frag",), ("smooth.frag",), ("lens.frag",))
        )
        self._noise = upload_with_mipmaps(self._context, make_noise())
        self._developed = [self._context.texture(size_px, 4), self._context.texture(size_px, 1, dtype="u2")]
        self._output = self._context.framebuffer(self._developed)
        self._targets: Targets | None = None
        self._relief: Relief | None = None
        self._props: tuple[Batch, ...] = ()
        self._static = Instances.of((), self._arena)
        self._lens_map: tuple[object, LensMap, Any] | None = None

    def _build(self, vertex: tuple[str, ...], fragment: tuple[str, ...]) -> Any:  # noqa: ANN401
        return build_program(self._context, vertex, fragment)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._context.release()

    def load(self, ground: Ground, props: Sequence[Batch]) -> None:
        """Upload a scene in place of the last one; meshes that were uploaded before are not sent again."""
        if self._relief is not None:
            self._relief.release()
        self._arena.forget_if_large()
        self._relief = Relief(self._context, ground)
        self._static = Instances.of(props, self._arena)

    def render(self, view: View, batches: Sequence[Batch], light: Light, look: Look) -> Rendered:
        """Draw the loaded scene with these moving batches, seen now."""
        if self._relief is None:
            raise RuntimeError("load a scene first")
        lens_map, undistorted = self._lens_of(view)
        frustum = Frustum(view, lens_map.origin_px, lens_map.size_px)
        targets = self._targets_of(lens_map.size_px)
        everything = self._static + Instances.of(batches, self._arena)
        box = self._draw_shadow(frustum, everything, light)
        visible = frustum.visible(everything)
        self._draw_ids(targets, frustum, visible, self._relief)
        self._draw_openness(targets, frustum)
        self._draw_colour(targets, frustum, visible, self._relief, self._lighting(light, box, frustum, targets))
        return self._develop(targets, frustum, undistorted, look)

    def silhouette_px(self, view: View, batches: Sequence[Batch]) -> int:
        """Count the pixels that the batches alone would cover, nothing in front, also outside the picture."""
        raise NotImplementedError

    def _lens_of(self, view: View) -> tuple[LensMap, Any]:
        camera = view.camera
        if (camera.width_px, camera.height_px) != self._size_px:
            raise ValueError(f"the camera is for {camera.width_px}x{camera.height_px}, the renderer {self._size_px}")
        key = (camera.matrix.tobytes(), camera.distortion.tobytes())
        if self._lens_map is None or self._lens_map[0] != key:
            if self._lens_map is not None:
                self._lens_map[2].release()
            lens_map = LensMap.of(camera, 0, 0, *self._size_px)
            drawn = (lens_map.undistorted_px - lens_map.origin_px).astype(np.float32)
            texture = self._context.texture(self._size_px, 2, drawn.tobytes(), dtype="f4")
            texture.filter = (self._context.NEAREST, self._context.NEAREST)
            self._lens_map = key, lens_map, texture
        return self._lens_map[1:]

    def _targets_of(self, size_px: tuple[int, int]) -> Targets:
        if self._targets is None or self._targets.size_px != size_px:
            if self._targets is not None:
                self._targets.release()
            self._targets = Targets(self._context, size_px, self._samples)
        return self._targets

    def _draw_shadow(self, frustum: Frustum, everything: Instances, light: Light) -> SunBox:
        assert self._relief is not None
        points = seen_points(frustum, self._relief.lowest_m, self._relief.highest_m + 9.0)
        box = fit_box(light.to_sun, points, everything, 1.0)
        self._context.enable_only(self._context.DEPTH_TEST)
        self._shadow.draw(box, everything, self._arena, self._relief)
        return box

    def _draw_ids(self, targets: Targets, frustum: Frustum, visible: Instances, relief: Relief) -> None:
        targets.id_pass.use()
        targets.id_pass.clear(depth=1.0)
        placed = {"clip_from_offset": frustum.clip_from_offset(), "origin": tuple(frustum.view.position_m.tolist())}
        for program in (self._thing_ids.program, self._ground_ids):
            set_uniforms(program, placed)
        self._thing_ids.draw(visible, self._arena)
        relief.draw(self._ground_ids, frustum)

    def _draw_openness(self, targets: Targets, frustum: Frustum) -> None:
        self._context.enable_only(self._context.NOTHING)
        shift = np.eye(3)
        shift[:2, 2] = frustum.origin_px
        matrix = frustum.view.camera.matrix
        set_uniforms(
            self._openness.program,
            {
                "depth": 0,
                "camera_from_pixel": np.linalg.inv(matrix) @ shift,
                "depth_range": (NEAR_M, FAR_M, float(OPENNESS_STEP_PX), float(matrix[0, 0])),
            },
        )
        targets.rough_pass.use()
        targets.depth.use(0)
        self._openness.render(vertices=3)
        targets.smooth_pass.use()
        targets.rough.use(0)
        set_uniforms(self._smooth.program, {"rough": 0})
        self._smooth.render(vertices=3)

    def _lighting(self, light: Light, box: SunBox, frustum: Frustum, targets: Targets) -> dict[str, object]:
        eye = frustum.view.position_m
        to_texture = np.diag([0.5, 0.5, 0.5, 1.0])
        to_texture[:3, 3] = 0.5
        from_offset = np.eye(4)
        from_offset[:3, 3] = eye
        size_m = box.high_m - box.low_m
        texel_m = float(size_m[:2].max()) / SHADOW_SIZE_PX
        softness = 0.5 * light.sun_softness_m_per_m * float(size_m[2]) / texel_m
        width, height = targets.size_px
        pixel_to_ray = np.linalg.inv(frustum.view.camera.matrix @ frustum.view.site_to_camera)
        shift = np.eye(3)
        shift[:2, 2] = frustum.origin_px
        return {
            "to_sun": tuple(np.asarray(light.to_sun, dtype=float).tolist()),
            "sun": light.sun,
            "sky": light.sky,
            "bounce": light.bounce,
            "haze_colour": light.haze,
            "haze_per_m": light.haze_per_m,
            "shadow_from_offset": to_texture @ box.clip_from_site() @ from_offset,
            "shadow_scale": (texel_m, softness, 1.0 / float(size_m[2]), 1.0 / SHADOW_SIZE_PX),
            "openness_scale": (1.0 / (OPENNESS_STEP_PX * targets.small_px[0]), 1.0 / (OPENNESS_STEP_PX * targets.small_px[1])),
            "clip_from_offset": frustum.clip_from_offset(),
            "origin": tuple(eye.tolist()),
            "offset_from_pixel": pixel_to_ray @ shift,
            "shadow_map": 0, "shadow_depth": 1, "openness": 2, "noise": 3, "picture": 4,
        }

    def _draw_colour(
        self, targets: Targets, frustum: Frustum, visible: Instances, relief: Relief, lighting: dict[str, object]
    ) -> None:
        self._context.enable_only(self._context.DEPTH_TEST)
        targets.colour_pass.use()
        targets.colour_pass.clear(depth=1.0)
        self._shadow.depth.use(0)
        self._shadow.depth.use(1)
        self._shadow.compared.use(0)
        self._shadow.plain.use(1)
        targets.smooth.use(2)
        self._noise.use(3)
        relief.picture.use(4)
        for program in (self._things.program, self._ground, self._sky.program):
            set_uniforms(program, {**lighting, **relief.uniforms, "surfaces": surface_table()})
        self._things.draw(visible, self._arena)
        relief.draw(self._ground, frustum)
        self._context.depth_func = "<="
        self._sky.render(vertices=3)
        self._context.depth_func = "<"
        self._shadow.compared.clear(0)
        self._shadow.plain.clear(1)
        self._context.copy_framebuffer(targets.resolved, targets.colour_pass)

    def _develop(self, targets: Targets, frustum: Frustum, undistorted: Any, look: Look) -> Rendered:  # noqa: ANN401
        self._context.enable_only(self._context.NOTHING)
        shift = np.eye(3)
        shift[:2, 2] = frustum.origin_px
        blur = np.eye(3) if look.blur is None else np.linalg.inv(shift) @ look.blur @ shift
        gain = look.exposure * np.array(look.white_balance)
        width, height = self._size_px
        set_uniforms(
            self._lens.program,
            {
                "drawn": 0, "drawn_ids": 1, "undistorted": 2,
                "drawn_texel": (1.0 / targets.size_px[0], 1.0 / targets.size_px[1]),
                "blur": blur,
                "blur_taps": 1 if look.blur is None else 7,
                "gain": tuple(gain.tolist()),
                "tone": (look.contrast, look.lift, look.saturation, look.vignette),
                "picture_centre": (width / 2, height / 2),
            },
        )
        self._output.use()
        targets.colour.use(0)
        targets.ids.use(1)
        undistorted.use(2)
        self._lens.render(vertices=3)
        picture = np.frombuffer(self._output.read(components=4, alignment=1), np.uint8).reshape(height, width, 4)
        ids = np.frombuffer(self._output.read(components=1, attachment=1, dtype="u2", alignment=1), np.uint16)
        return Rendered(np.ascontiguousarray(picture[..., :3]), ids.reshape(height, width).copy())
