from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest

from standoff_sim.composites.blending import Match, blend, decoded, encoded
from standoff_sim.render import Cutout

_SHAPE = (64, 96)


def _match(**other: float) -> Match:
    values = {"saturation": 1.0, "contrast": 1.0, "veil": 0.0, "softness_px": 0.0, "grain": 1e-6, **other}
    return Match(np.ones(3, np.float32), **values)


def _cutout(alpha: float, colour: float) -> Cutout:
    light = np.zeros((*_SHAPE, 4), np.float32)
    light[20:40, 30:60] = (colour, colour, colour, alpha)
    return Cutout(light, np.zeros(_SHAPE, np.uint16))


def _photo(level: int) -> npt.NDArray[np.uint8]:
    return np.full((*_SHAPE, 3), level, np.uint8)


def test_encoding_undoes_decoding() -> None:
    codes = np.arange(256, dtype=np.uint8).reshape(1, 256, 1).repeat(3, axis=2)
    assert (encoded(decoded(codes)) == codes).all()


@pytest.mark.parametrize("level", [30, 120, 220])
def test_nothing_changes_where_nothing_lies(level: int) -> None:
    blended = blend(np.random.default_rng(0), _photo(level), _cutout(1.0, 0.2), _match())
    untouched = np.ones(_SHAPE, bool)
    untouched[20:40, 30:60] = False
    assert (blended[untouched] == level).all()


def test_a_solid_thing_hides_the_photograph() -> None:
    dark, bright = (blend(np.random.default_rng(0), _photo(v), _cutout(1.0, 0.2), _match()) for v in (80, 220))
    assert (dark[25:35, 35:55] == bright[25:35, 35:55]).all()
    np.testing.assert_allclose(decoded(dark)[25:35, 35:55], 0.2, atol=0.004)


def test_a_shadow_takes_its_share_of_the_light_and_most_of_the_yellow() -> None:
    photo = _photo(180)
    shaded = blend(np.random.default_rng(0), photo, _cutout(0.6, 0.0), _match())
    share = (decoded(shaded) / decoded(photo))[30, 45]
    assert share[1] == pytest.approx(0.4, abs=0.01)
    assert share[0] > share[1] > share[2], "blue, green, red"


def test_a_shadow_in_the_shade_takes_less() -> None:
    photo = np.full((200, 600, 3), 180, np.uint8)
    photo[:, :200] = 40  # the left third lies in shade
    light = np.zeros((200, 600, 4), np.float32)
    light[..., 3] = 0.6
    blended = decoded(blend(np.random.default_rng(0), photo, Cutout(light, np.zeros((200, 600), np.uint16)), _match()))
    share = blended[100, :, 1] / decoded(photo)[100, :, 1]
    assert share[10] > 0.8 and share[590] == pytest.approx(0.4, abs=0.02)


def test_a_soft_edge_shows_both_sides_and_no_third() -> None:
    blended = blend(np.random.default_rng(0), _photo(90), _cutout(1.0, 0.5), _match(softness_px=1.5)).astype(int)
    inside = blended[30, 45, 1]
    across = blended[30, :46, 1]
    assert (np.diff(across) >= 0).all() and across[0] == 90 and across[-1] == inside
    assert len(set(across.tolist())) > 5


def test_grain_is_as_strong_as_asked() -> None:
    blended = blend(np.random.default_rng(3), _photo(90), _cutout(1.0, 0.2), _match(grain=0.05))
    inside = decoded(blended)[20:40, 30:60, 1]
    assert inside.std() / inside.mean() == pytest.approx(0.05, rel=0.15)
