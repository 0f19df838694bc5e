"""From an outfit to the meshes that show it: which garment hangs on which part of the body, in which colour."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from standoff.core.homography import FloatArray
from standoff_sim.people import clothing, headgear
from standoff_sim.people.outfit import Outfit
from standoff_sim.solids.mesh import Colour, Mesh, scaling

_SNUG = np.eye(4)
_WHITE = (1.0, 1.0, 1.0)


class Garment(NamedTuple):
    """A mesh on a part of the body: the part's frame by name, scaling within it, colour."""

    mesh: Mesh
    frame: str
    fit: FloatArray
    tint: Colour


@lru_cache(maxsize=512)
def worn(outfit: Outfit, build: str) -> tuple[Garment, ...]:
    """Return everything that is to be seen of a person, skin included.

    Args:
        outfit: Clothes.
        build: One of `clothing.BUILDS`.
    """
    return tuple(_upper_body(outfit, build) + _legs(outfit) + _head(outfit) + _extras(outfit))


def _upper_body(outfit: Outfit, build: str) -> list[Garment]:
    cover = outfit.hi_vis_colour if outfit.hi_vis == "whole" else outfit.top
    sleeve = scaling(*(1.14 if outfit.jacket else 1.04,) * 2, 1.0)
    garments = [
        Garment(clothing.shirt(build, outfit.jacket), "chest", _SNUG, cover),
        Garment(clothing.hem(build, outfit.jacket), "pelvis", _SNUG, _shaded(cover, 0.93)),
    ]
    for name, bare in (("upper_arm", outfit.sleeves == "none"), ("forearm", outfit.sleeves != "long")):
        tint = outfit.skin if bare else _shaded(cover, 0.95)
        garments.append(Garment(clothing.part(name, bare), name, scaling(0.9, 0.9, 1.0) if bare else sleeve, tint))
    garments.append(Garment(clothing.part("hand", outfit.gloves is None), "hand", _SNUG, outfit.gloves or outfit.skin))
    if outfit.hi_vis != "none":
        open_front = outfit.open_front and outfit.hi_vis == "vest"
        vest = clothing.vest(build, outfit.bands, open_front, outfit.jacket)
        garments.append(Garment(vest, "chest", _SNUG, outfit.hi_vis_colour))
    return garments


def _legs(outfit: Outfit) -> list[Garment]:
    wide = scaling(outfit.trouser_width, outfit.trouser_width, 1.0)
    shin = (
        Garment(clothing.part("shin", True), "shin", scaling(0.75, 0.75, 1.0), outfit.skin)
        if outfit.shorts
        else Garment(clothing.part("shin", False), "shin", wide, _shaded(outfit.trousers, 0.92))
    )
    garments = [
        Garment(clothing.part("pelvis", False), "pelvis", _SNUG, outfit.trousers),
        Garment(clothing.part("thigh", False), "thigh", wide, outfit.trousers),
        shin,
        Garment(clothing.boot(outfit.rubber_boots), "boot", _SNUG, outfit.boots),
    ]
    if outfit.rubber_boots:
        garments.append(Garment(clothing.rubber_leg(), "shin", wide, outfit.boots))
    return garments


def _head(outfit: Outfit) -> list[Garment]:
    garments = [
        Garment(clothing.part("neck", True), "head", _SNUG, outfit.skin),
        Garment(clothing.part("head", True), "head", _SNUG, outfit.skin),
    ]
    if outfit.hair is not None:
        garments.append(Garment(headgear.hair(), "head", _SNUG, outfit.hair))
    if outfit.hat != "none":
        garments.append(Garment(headgear.headgear(outfit.hat), "head", _SNUG, outfit.hat_colour))
    return garments


def _extras(outfit: Outfit) -> list[Garment]:
    garments = []
    if outfit.belt:
        garments.append(Garment(clothing.tool_belt(), "pelvis", _SNUG, _WHITE))
    if outfit.backpack is not None:
        garments.append(Garment(clothing.backpack(), "chest", _SNUG, outfit.backpack))
    return garments


def _shaded(colour: Colour, share: float) -> Colour:
    return colour[0] * share, colour[1] * share, colour[2] * share
