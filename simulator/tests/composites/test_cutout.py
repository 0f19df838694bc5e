"""Cut-out things over a picture of the bare ground against the same scene drawn as a whole."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from flat_ground import FlatGround, camera, light, view

from standoff.core.homography import FloatArray
from standoff.core.pose import View
from standoff_sim.composites.blending import decoded
from standoff_sim.render import Look, Renderer
from standoff_sim.scene.scene import Batch, place
from standoff_sim.solids.mesh import box, rotation, srgb, translation

_LINEAR = Look(exposure=0.5)
"""Dark enough to stay below the tone curve's knee."""


@pytest.fixture(scope="module")
def renderer(opengl: None) -> Iterator[Renderer]:
    with Renderer((320, 240)) as made:
        made.load(FlatGround(), ())
        yield made


def _boxed(turn_deg: float) -> Batch:
    pose = translation(0.0, 0.0, 0.6) @ rotation("z", turn_deg)
    return place(box((3.0, 2.0, 1.2), srgb("#a06030")), pose, dust=0.0, entity_id=7)


def _seen(pitch_deg: float) -> View:
    return view(camera(), pitch_deg=pitch_deg)


@pytest.mark.parametrize(("pitch_deg", "turn_deg"), [(89.0, 10.0), (60.0, 25.0), (35.0, 70.0)])
def test_a_cutout_over_the_bare_ground_is_the_whole_picture(
    renderer: Renderer, pitch_deg: float, turn_deg: float
) -> None:
    seen, thing = _seen(pitch_deg), _boxed(turn_deg)
    whole = renderer.render(seen, (thing,), light(), _LINEAR)
    bare = decoded(renderer.render(seen, (), light(), _LINEAR).image)
    cutout = renderer.cut_out(seen, (thing,), light())
    alpha = cutout.light[..., 3:]
    laid: FloatArray = bare * (1.0 - alpha) + _LINEAR.exposure * cutout.light[..., 2::-1]
    away = np.abs(laid - decoded(whole.image)).mean(axis=-1)
    assert (whole.ids == cutout.ids).all()
    assert away[cutout.ids == 7].max() < 0.02
    # on the ground colours differ: light from the sky is bluer than that from the sun
    assert np.quantile(away, 0.995) < 0.02
    shadow = (cutout.ids == 0) & (alpha[..., 0] > 0.5)
    assert shadow.sum() > 100
    assert laid[shadow].mean() == pytest.approx(decoded(whole.image)[shadow].mean(), rel=0.08)


def test_there_is_nothing_where_nothing_stands(renderer: Renderer) -> None:
    light_there = renderer.cut_out(_seen(60.0), (), light()).light
    assert (light_there[..., :3] == 0.0).all() and light_there[..., 3].max() < 0.01


def test_a_distorting_lens_is_refused(renderer: Renderer) -> None:
    with pytest.raises(ValueError, match="distortion"):
        renderer.cut_out(view(camera(distortion=(-0.1, 0.0, 0.0, 0.0, 0.0))), (), light())
