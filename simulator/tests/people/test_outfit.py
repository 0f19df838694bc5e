from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from standoff_sim.people.outfit import HARD_HAT_COLOURS, HAT_SHARES, HI_VIS_SHARE, Outfit, choose_outfit
from standoff_sim.solids.mesh import Colour

COUNT = 400
THREE_SIGMA = 3.0 * 0.5 / COUNT**0.5


@pytest.fixture(scope="module")
def outfits() -> list[Outfit]:
    rng = np.random.default_rng(20)
    return [choose_outfit(rng) for _ in range(COUNT)]


def luminance(colour: Colour) -> float:
    return float(np.dot(colour, (0.2126, 0.7152, 0.0722)))


def share(flags: list[bool]) -> float:
    return sum(flags) / len(flags)


def test_every_second_person_wears_hi_vis(outfits: list[Outfit]) -> None:
    assert share([outfit.hi_vis != "none" for outfit in outfits]) == pytest.approx(HI_VIS_SHARE, abs=THREE_SIGMA)


def test_dark_and_pale_clothes_are_as_common_as_documented(outfits: list[Outfit]) -> None:
    assert share([luminance(outfit.top) < 0.09 for outfit in outfits]) > 0.40
    assert share([luminance(outfit.top) > 0.30 for outfit in outfits]) > 0.20
    assert share([luminance(outfit.trousers) < 0.12 for outfit in outfits]) > 0.55


def test_hats_are_as_common_as_documented(outfits: list[Outfit]) -> None:
    counts = Counter(outfit.hat for outfit in outfits)
    for kind, expected in HAT_SHARES.items():
        assert counts[kind] / COUNT == pytest.approx(expected, abs=THREE_SIGMA), kind


def test_hi_vis_comes_in_lime_and_orange_and_red(outfits: list[Outfit]) -> None:
    colours = np.array([outfit.hi_vis_colour for outfit in outfits if outfit.hi_vis != "none"])
    lime = (colours[:, 1] > 0.8 * colours[:, 0]).mean()
    red = (colours[:, 1] < 0.2 * colours[:, 0]).mean()
    assert 0.3 < lime < 0.6
    assert 0.02 < red < 0.4


def test_helmets_come_in_every_usual_colour(outfits: list[Outfit]) -> None:
    assert sum(HARD_HAT_COLOURS.values()) == pytest.approx(1.0)
    colours = np.array([outfit.hat_colour for outfit in outfits if outfit.hat.startswith("hard_hat")])
    strongest = np.argmax(colours, axis=1)
    grey = np.ptp(colours, axis=1) < 0.25 * colours.max(axis=1)
    assert 0.15 < grey.mean() < 0.5
    assert set(strongest[~grey].tolist()) == {0, 1, 2}


def test_no_two_garments_have_the_very_same_colour(outfits: list[Outfit]) -> None:
    assert len({outfit.top for outfit in outfits}) == COUNT
    assert len({outfit.trousers for outfit in outfits}) == COUNT


def test_skins_of_all_kinds_are_met(outfits: list[Outfit]) -> None:
    lightness = np.array([luminance(outfit.skin) for outfit in outfits])
    assert (lightness < 0.1).mean() > 0.1
    assert (lightness > 0.35).mean() > 0.15


def test_albedos_are_those_of_real_cloth(outfits: list[Outfit]) -> None:
    tints = np.array([[o.hat_colour, o.top, o.hi_vis_colour, o.trousers, o.skin, o.boots] for o in outfits])
    assert tints.min() >= 0.012
    assert tints.max() <= 0.80
