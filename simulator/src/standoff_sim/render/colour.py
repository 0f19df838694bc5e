"""The colour pass: everything that the pinhole camera sees, lit, in linear light."""

from __future__ import annotations

from typing import Any

import numpy as np

from standoff_sim.render.context import build_program, set_uniforms
from standoff_sim.render.frustum import FAR_M, NEAR_M, Frustum
from standoff_sim.render.geometry import Arena, InstanceDrawer, Instances
from standoff_sim.render.ground_buffers import GroundBuffers, upload_with_mipmaps
from standoff_sim.render.noise import make_noise
from standoff_sim.render.shadow import ShadowMap, SunBox
from standoff_sim.render.surfaces import surface_table
from standoff_sim.render.targets import OPENNESS_STEP_PX, Targets
from standoff_sim.scene.scene import Light

_UNITS = {
    "shadow_map": 0,
    "shadow_depth": 1,
    "openness": 2,
    "noise": 3,
    "picture": 4,
    "slopes": 5,
    "ground_depth": 6,
    "ground_radiance": 7,
}


class ColourPass:
    """Draws things, ground and sky with several samples a pixel."""

    def __init__(self, context: Any) -> None:  # noqa: ANN401
        self._context = context
        lit = "light.glsl"
        self._things = InstanceDrawer(context, build_program(context, ("instances.vert",), (lit, "instances.frag")))
        self._ground_depth = build_program(context, ("depth_ground.vert",), ("nothing.frag",))
        self._ground, self._matte = (
            context.vertex_array(build_program(context, ("fullscreen.vert",), (lit, fragment)), [])
            for fragment in ("ground.frag", "matte.frag")
        )
        self._ground_copy = build_program(context, ("depth_ground.vert",), ("ground_copy.frag",))
        self._sky = context.vertex_array(build_program(context, ("fullscreen.vert",), (lit, "sky.frag")), [])
        self._noise = upload_with_mipmaps(context, make_noise(), smooth=False)
        set_uniforms(self._things.program, {"surfaces": surface_table()})

    def draw(
        self, targets: Targets, frustum: Frustum, visible: Instances, arena: Arena, relief: GroundBuffers,
        shadow: ShadowMap, sun: dict[str, object], *, cut_out: bool = False,
    ) -> None:  # fmt: skip
        """Fill `targets.colour`; `sun` are the uniforms of `sun_uniforms`.

        Cut out, there is neither ground nor sky: alpha is 1 on things, and on the ground the share of light that they
        take away.
        """
        units = {
            "openness": targets.smooth, "noise": self._noise, "picture": relief.picture, "slopes": relief.slopes,
            "ground_depth": targets.ground_depth, "ground_radiance": targets.ground,
        }  # fmt: skip
        pixel_to_ray = np.linalg.inv(frustum.view.camera.matrix @ frustum.view.site_to_camera)
        values = {
            **sun,
            **relief.uniforms,
            **_UNITS,
            "clip_from_offset": frustum.clip_from_offset(),
            "origin": tuple(frustum.view.position_m.tolist()),
            "offset_from_pixel": pixel_to_ray @ frustum.undistorted_from_drawn(),
            "openness_scale": tuple(1.0 / (OPENNESS_STEP_PX * length) for length in targets.small_px),
            "depth_range": (NEAR_M, FAR_M),
        }
        ground = self._matte if cut_out else self._ground
        for program in (self._things.program, self._sky.program, ground.program, self._ground_copy, self._ground_depth):
            set_uniforms(program, values)
        shadow.use(_UNITS["shadow_map"], _UNITS["shadow_depth"])
        for name, texture in units.items():
            texture.use(_UNITS[name])
        self._light_ground(targets, frustum, relief, ground)
        self._draw_samples(targets, frustum, visible, arena, relief, sky=not cut_out)
        shadow.unuse(_UNITS["shadow_map"], _UNITS["shadow_depth"])
        self._context.copy_framebuffer(targets.resolved, targets.colour_pass)

    def _light_ground(self, targets: Targets, frustum: Frustum, relief: GroundBuffers, ground: Any) -> None:  # noqa: ANN401
        self._context.enable_only(self._context.DEPTH_TEST)
        targets.ground_depth_pass.use()
        targets.ground_depth_pass.clear(depth=1.0)
        relief.draw(self._ground_depth, frustum)
        self._context.enable_only(self._context.NOTHING)
        targets.ground_pass.use()
        ground.render(vertices=3)

    def _draw_samples(
        self, targets: Targets, frustum: Frustum, visible: Instances, arena: Arena, relief: GroundBuffers, *, sky: bool
    ) -> None:
        context = self._context
        context.enable_only(context.DEPTH_TEST)
        targets.colour_pass.use()
        targets.colour_pass.clear(depth=1.0)
        self._things.draw(visible, arena)
        relief.draw(self._ground_copy, frustum)
        if sky:
            context.depth_func = "<="
            self._sky.render(vertices=3)
            context.depth_func = "<"


def sun_uniforms(light: Light, box: SunBox, shadow: ShadowMap, frustum: Frustum) -> dict[str, object]:
    """Return what light.glsl needs to know about sun, sky and shadow."""
    to_texture = np.diag([0.5, 0.5, 0.5, 1.0])
    to_texture[:3, 3] = 0.5
    from_offset = np.eye(4)
    from_offset[:3, 3] = frustum.view.position_m
    size_m = box.high_m - box.low_m
    texel_m = float(size_m[:2].max()) / shadow.size_px
    radius_texels = 0.5 * light.sun_softness_m_per_m * float(size_m[2]) / texel_m
    return {
        "to_sun": tuple(np.asarray(light.to_sun, dtype=float).tolist()),
        "sun": light.sun,
        "sky": light.sky,
        "bounce": light.bounce,
        "haze_colour": light.haze,
        "haze_per_m": light.haze_per_m,
        "shadow_from_offset": to_texture @ box.clip_from_site() @ from_offset,
        "shadow_scale": (texel_m, radius_texels, 1.0 / float(size_m[2]), 1.0 / shadow.size_px),
    }
