"""The reference object of known shape; `covers` has what comes to lie on it.

Its four upper corners are vertices of its mesh, its edges are sharp: what a corner fit finds in a picture is the truth.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from itertools import pairwise
from types import MappingProxyType

import numpy as np

from standoff.core.errors import ConfigError
from standoff.core.homography import FloatArray
from standoff_sim.props.materials import block, relief
from standoff_sim.props.rebar import starters
from standoff_sim.scene.scene import GroundSurface, Reference, place
from standoff_sim.solids.mesh import Colour, Mesh, Surface, box, join, rotation, srgb, toned, translation
from standoff_sim.solids.panels import panels

SQUARE_FOOTING_M = 2.89
"""Side of the paper's square footing (section 6.1)."""
BOARD_M = 25.0
"""Side of the paper's checkerboard (section 5.2) at full size."""
BOARD_SQUARES = 8
_BOARD_THICKNESS_M = 0.02
_PAINT_THICKNESS_M = 0.005
_ROOT_M = 0.5
"""How deep the sides reach below the ground, so that no light passes under them."""

_WHITE = srgb("#d9d6cd")
_YELLOW = srgb("#d8a51c")
_BLACK = srgb("#232323")
_CONCRETES = tuple(srgb(code) for code in ("#d2cec4", "#dad6cb", "#c6c3bb", "#d8d6cf"))


def make_reference(
    rng: np.random.Generator, kind: str, centre_xy_m: tuple[float, float], heading_deg: float, ground: GroundSurface,
    entity_id: int, *, worn: bool = True,
) -> Reference:  # fmt: skip
    """Build a reference object on level ground.

    Corners go counter-clockwise from above and start in the local south-west (x and y least). The painted square is
    5 mm thick and the board 20 mm: their base is that much below their top, no more.

    Args:
        rng: Decides sizes where the kind leaves them open, stubs and stains.
        kind: One of `REFERENCE_KINDS`.
        centre_xy_m: Site frame.
        heading_deg: Direction of the local x axis (the first edge of a square), counter-clockwise from east.
        ground: Level there; where it is not, the object stands on the highest point under it.
        entity_id: Of the truth.
        worn: Stained, dusty and perhaps with a column stub on it; else clean and bare.

    Raises:
        ConfigError: Unknown kind.
    """
    if kind not in _MAKERS:
        raise ConfigError(expected=f"one of {', '.join(_MAKERS)}", found=repr(kind), fix="choose one of these shapes")
    corners_m, height_m, mesh, root = _MAKERS[kind](rng, worn)
    upright = translation(*centre_xy_m, 0.0) @ rotation("z", heading_deg)
    flat_site = _through(upright, corners_m, 0.0)[:, :2]
    grid = _bilinear(flat_site, 9).reshape(-1, 2)
    level_m = float(np.max(ground.height_at(grid)))
    pose = (translation(0.0, 0.0, level_m) @ upright).astype(np.float32).astype(np.float64)
    top_m = _through(pose, corners_m, height_m)
    base_m = np.column_stack([top_m[:, :2], ground.height_at(top_m[:, :2])])
    dust = float(rng.uniform(0.05, 0.3)) if worn else 0.0
    seen, buried = place(mesh, pose, dust=dust, entity_id=entity_id), place(root, pose, dust=dust)
    return Reference(top_m, base_m, (seen,), (buried,), (), entity_id)


def board_corners_m(reference: Reference) -> FloatArray:
    """Return (49, 3) inner corners of a board, site frame: row by row along its x axis, from the top-left (-x, +y)."""
    south_west, south_east, north_east, north_west = reference.top_m
    share = np.arange(1, BOARD_SQUARES) / BOARD_SQUARES
    across, down = np.meshgrid(share, share)
    across, down = across.reshape(-1, 1), down.reshape(-1, 1)
    upper = north_west * (1 - across) + north_east * across
    lower = south_west * (1 - across) + south_east * across
    return np.asarray(upper * (1 - down) + lower * down)


def _square(side_m: float) -> FloatArray:
    return np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]) * side_m / 2


def _quadrilateral(rng: np.random.Generator) -> FloatArray:
    """A convex quadrilateral, sides 2 to 4 m, clearly no rectangle, centred on its corners' mean."""
    while True:
        corners = _square(1.0) * rng.uniform(2.5, 3.5, 2) + rng.uniform(-0.55, 0.55, (4, 2))
        edges = np.roll(corners, -1, axis=0) - corners
        sides_m = np.linalg.norm(edges, axis=1)
        turns_deg = np.rad2deg(np.arcsin(_cross(edges, np.roll(edges, -1, axis=0)) / sides_m / np.roll(sides_m, -1)))
        skew_deg = np.abs(np.rad2deg(np.arctan2(_cross(edges[:2], -edges[2:]), -(edges[:2] * edges[2:]).sum(axis=1))))
        if sides_m.min() > 2.0 and sides_m.max() < 4.0 and turns_deg.min() > 65.0 and skew_deg.min() > 4.0:
            return np.asarray(corners - corners.mean(axis=0))


def _cross(first: FloatArray, second: FloatArray) -> FloatArray:
    return np.asarray(first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0])


def _bilinear(corners: FloatArray, count: int) -> FloatArray:
    """Return (count, count, D) points over a quadrilateral: rows along its first edge, columns along its last."""
    u, v = np.meshgrid(np.linspace(0.0, 1.0, count), np.linspace(0.0, 1.0, count), indexing="ij")
    u, v = u[..., None], v[..., None]
    low, high = corners[0] * (1 - u) + corners[1] * u, corners[3] * (1 - u) + corners[2] * u
    return np.asarray(low * (1 - v) + high * v)


def _through(pose: FloatArray, corners_m: FloatArray, z_m: float) -> FloatArray:
    """Return where the float32 vertices of a mesh come to lie, in float64."""
    vertices = np.column_stack([corners_m, np.full(len(corners_m), z_m)]).astype(np.float32).astype(np.float64)
    matrix = np.asarray(pose, dtype=np.float64)
    return np.asarray(vertices @ matrix[:3, :3].T + matrix[:3, 3])


def _prism(corners_m: FloatArray, height_m: float, colour: Colour, surface: Surface, stains: float) -> Mesh:
    """Return a block with exact corners, its faces cut finely enough to carry stains."""
    count = 9 if stains else 2
    top = _bilinear(corners_m, count)
    faces = [np.concatenate([top, np.full((*top.shape[:2], 1), height_m)], axis=-1)]
    faces += _sides(corners_m, height_m, 0.0, count)
    return join([relief(face, colour, surface, mottling=stains) for face in faces])


def _root(corners_m: FloatArray, colour: Colour, surface: Surface) -> Mesh:
    """Return the sides below the ground, so that no gap shows where it is not quite level."""
    return join([relief(face, colour, surface) for face in _sides(corners_m, 0.0, -_ROOT_M, 2)])


def _sides(corners_m: FloatArray, high_m: float, low_m: float, count: int) -> list[FloatArray]:
    steps = np.linspace(0.0, 1.0, count)[:, None]
    lines = [start * (1 - steps) + stop * steps for start, stop in pairwise(np.vstack([corners_m, corners_m[:1]]))]
    return [np.stack([np.column_stack([line, np.full(count, z)]) for z in (high_m, low_m)]) for line in lines]


Made = tuple[FloatArray, float, Mesh, Mesh]
"""(4, 2) corners in the local frame, height of the top, look above the ground and below it."""


def _footing(rng: np.random.Generator, corners_m: FloatArray, height_m: float, worn: bool) -> Made:
    colour = _CONCRETES[int(rng.integers(len(_CONCRETES)))]
    parts = [_prism(corners_m, height_m, colour, Surface.CONCRETE, 0.1 if worn else 0.0)]
    if worn and rng.uniform() < 0.6:
        parts += _stub(rng, height_m, colour)
    return corners_m, height_m, join(parts), _root(corners_m, colour, Surface.CONCRETE)


def _stub(rng: np.random.Generator, height_m: float, colour: Colour) -> list[Mesh]:
    """A column stub or bare starter bars around the middle, far from the four upper edges."""
    side_m = rng.uniform(0.35, 0.55)
    stub_m = rng.uniform(0.15, 0.5) if rng.uniform() < 0.5 else 0.0
    parts = starters(rng, (side_m - 0.1, side_m - 0.1), height_m + stub_m, rng.uniform(0.4, 0.7), 0.15)
    if stub_m:
        parts.append(toned(block((side_m, side_m, stub_m), colour, Surface.CONCRETE), 0.9).at(0.0, 0.0, height_m))
    return parts


def _make_square_footing(rng: np.random.Generator, worn: bool) -> Made:
    return _footing(rng, _square(SQUARE_FOOTING_M), float(rng.uniform(0.4, 0.6)), worn)


def _make_quadrilateral_footing(rng: np.random.Generator, worn: bool) -> Made:
    return _footing(rng, _quadrilateral(rng), float(rng.uniform(0.25, 0.35)), worn)


def _make_painted_square(rng: np.random.Generator, worn: bool) -> Made:
    corners_m = _square(float(rng.uniform(2.0, 3.0)))
    colour = _WHITE if rng.uniform() < 0.5 else _YELLOW
    plate = _prism(corners_m, _PAINT_THICKNESS_M, colour, Surface.PAINT, 0.06 if worn else 0.0)
    return corners_m, _PAINT_THICKNESS_M, plate, _root(corners_m, colour, Surface.PAINT)


def _make_board(rng: np.random.Generator, worn: bool) -> Made:
    corners_m = _square(BOARD_M)
    nodes = _bilinear(corners_m, BOARD_SQUARES + 1)
    nodes = np.concatenate([nodes, np.full((*nodes.shape[:2], 1), _BOARD_THICKNESS_M)], axis=-1)
    squares = np.stack([nodes[:-1, :-1], nodes[1:, :-1], nodes[1:, 1:], nodes[:-1, 1:]], axis=2)
    odd = np.indices((BOARD_SQUARES, BOARD_SQUARES)).sum(axis=0) % 2 == 1
    painted = []
    for chosen, colour in ((odd, _WHITE), (~odd, _BLACK)):
        mesh = panels(squares[chosen], colour, Surface.PAINT)
        tones = rng.uniform(0.9, 1.0, int(chosen.sum())) if worn else np.ones(int(chosen.sum()))
        painted.append(toned(mesh, np.repeat(tones, 4)))
    under = box((BOARD_M, BOARD_M, _ROOT_M), _BLACK, Surface.PAINT).at(0.0, 0.0, _BOARD_THICKNESS_M - 0.004 - _ROOT_M)
    return corners_m, _BOARD_THICKNESS_M, join(painted), under


_MAKERS: Mapping[str, Callable[[np.random.Generator, bool], Made]] = MappingProxyType({
    "square_footing": _make_square_footing,
    "quadrilateral_footing": _make_quadrilateral_footing,
    "painted_square": _make_painted_square,
    "board": _make_board,
})  # fmt: skip

REFERENCE_KINDS = tuple(_MAKERS)
