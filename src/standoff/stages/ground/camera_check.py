"""Whether a camera that somebody stated can be one, of pictures of this size."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Final

import numpy as np

from standoff.core.camera import Camera, CameraPrior, Lens
from standoff.core.errors import GroundError
from standoff.core.homography import FloatArray

_SHORTEST: Final[Mapping[Lens, float]] = {"brown": 0.3, "fisheye": 0.1}
"""Focal lengths in longer sides of the picture: no lens that keeps lines straight sees more than 118 degrees; of a
fisheye's whole circle even a small one in the picture's middle is longer."""
_LONGEST: Final = 20.0
"""One that sees three degrees: the longest zooms of drones see four."""
_MOST_OBLONG: Final = 2.0
"""Pixels may be so much longer than high, or higher than long: anamorphic lenses and broadcast pictures stay below."""
_CENTRAL: Final = 0.1
"""The lens's axis is no nearer to the picture's edge, as a share of its side."""
_USUAL: Final = 0.1
"""The axis of most lenses is no farther from the middle, as a share of the picture's side; few are half as far off."""
_SAME_SHAPE: Final = 0.05
_SQUEEZED, _STRETCHED = 2.0, 0.8
"""How far from the axis a pinhole shows what a lens shows at 1: wide barrels that Brown and Conrady's polynomial still
describes reach 1.6 in the corners, cushions 0.9."""
_DESCRIBED: Final = 0.8
"""Of the way to the corners: many a polynomial that was fitted to the middle of a wide picture turns back beyond."""


def check_focal(size_px: FloatArray, matrix: FloatArray, lens: Lens, path: Path) -> None:
    """Refuse focal lengths that are in no pixels of such a picture, and say what they are likely in.

    Raises:
        GroundError: They are not.
    """
    fx, fy = np.diag(matrix)[:2].tolist()
    if min(fx, fy) <= 0.0:
        raise GroundError(expected="focal lengths above 0", found=f"{fx:g}, {fy:g} in {path}", fix="correct the file")
    longer_px = float(size_px.max())
    for name, focal in (("fx", fx), ("fy", fy)):
        if not _SHORTEST[lens] <= focal / longer_px <= _LONGEST:
            raise GroundError(
                expected=f"{name} in pixels, of which the picture is {longer_px:g} long",
                found=f"{focal:g} in {path}, {_likely_unit(focal, longer_px)}",
                fix="multiply millimetres by the picture's width in pixels and divide by the sensor's in millimetres",
            )
    if not 1.0 / _MOST_OBLONG < fx / fy < _MOST_OBLONG:
        found = f"{fx:g} and {fy:g} in {path}"
        raise GroundError(expected="fx and fy of about square pixels", found=found, fix="correct the file")


def _likely_unit(focal: float, longer_px: float) -> str:
    if focal > longer_px:
        return "likely of a far larger picture"
    if focal < 0.3:
        return "likely in metres"
    if focal < 3.0:
        return "likely a share of the picture's width"
    return "likely in millimetres" if focal < 200.0 else "likely of a smaller picture"


def check_axis(size_px: FloatArray, matrix: FloatArray, path: Path) -> None:
    """Refuse a principal point at the picture's edge, and one that is the middle of a picture of another size.

    Raises:
        GroundError: It is.
    """
    width_px, height_px = size_px
    likely_px = np.round(2.0 * matrix[:2, 2] + 1.0)
    times = likely_px / size_px
    turned = (abs(likely_px / size_px[::-1] - 1.0) < _SAME_SHAPE).all()
    scaled = abs(times[0] / times[1] - 1.0) < _SAME_SHAPE
    if (abs(times - 1.0) > 2.0 * _USUAL).all() and (turned or scaled):
        found = f"{matrix[0, 2]:g}, {matrix[1, 2]:g} in {path}, the middle of one of {likely_px[0]:g}x{likely_px[1]:g}"
    elif not ((times > 2.0 * _CENTRAL) & (times < 2.0 - 2.0 * _CENTRAL)).all():
        found = f"{matrix[0, 2]:g}, {matrix[1, 2]:g} in {path}"
    else:
        return
    raise GroundError(
        expected=f"cx, cy in the middle of the {width_px:g}x{height_px:g} picture",
        found=found,
        fix="give the size of the pictures that the camera was calibrated on, and cx, cy in pixels",
    )


def lens_warnings(prior: CameraPrior | None) -> list[str]:
    """Say what is odd about a stated lens, and can be so."""
    return [] if prior is None else [*_off_axis(prior), *_undescribed(prior)]


def _undescribed(prior: CameraPrior) -> list[str]:
    if prior.camera.lens == "fisheye" or not np.isnan(prior.camera.undistort(_edge_px(prior.camera))).any():
        return []
    return [f"the distortion of the {prior.origin} does not reach the picture's edge: nothing is measured there"]


def _off_axis(prior: CameraPrior) -> list[str]:
    """Of a picture that was cut it can be unusually far from the middle."""
    camera = prior.camera
    size_px, axis_px = np.array([camera.width_px, camera.height_px]), camera.matrix[:2, 2]
    off = float(abs((axis_px + 0.5) / size_px - 0.5).max())
    if off <= _USUAL:
        return []
    return [
        f"the lens's axis is at {axis_px[0]:.0f}, {axis_px[1]:.0f} of {camera.width_px}x{camera.height_px}, "
        f"{100 * off:.0f} % of the side from the middle: is the {prior.origin} of pictures that were cut?"
    ]


def check_distortion(camera: Camera, path: Path) -> None:
    """Refuse coefficients that no lens has.

    Raises:
        GroundError: They are such.
    """
    doing = impossible_distortion(camera)
    if not doing:
        return
    names = ("k1", "k2", "k3", "k4") if camera.lens == "fisheye" else ("k1", "k2", "p1", "p2", "k3")
    given = zip(names, camera.distortion.tolist(), strict=True)
    raise GroundError(
        expected="distortion coefficients of a lens",
        found=f"{', '.join(f'{name} {value:g}' for name, value in given if value)} in {path}, by which {doing}",
        fix="calibrate again with the board in the corners, too, and check the order and model of the coefficients",
    )


def impossible_distortion(camera: Camera) -> str:
    """Say what no lens does and these coefficients do: fold the picture, or send its edge elsewhere; "" if nothing."""
    if not camera.bends:
        return ""
    edge_px, axis_px, focal_px = _edge_px(camera), camera.matrix[:2, 2], np.diag(camera.matrix)[:2]
    seen = np.linalg.norm((edge_px - axis_px) / focal_px, axis=1)
    straight = np.linalg.norm((camera.undistort(edge_px) - axis_px) / focal_px, axis=1)
    times = (straight / seen)[~np.isnan(straight)]
    if camera.lens == "fisheye":
        # What a fisheye shows beyond 90 degrees, or in the black around its circle, has no place in a pinhole's.
        folds, strained = bool(np.isnan(straight[np.argmin(seen)])), False
    else:
        folds = bool(np.isnan(camera.undistort(axis_px + _DESCRIBED * (edge_px - axis_px))).any())
        strained = bool((times > _SQUEEZED).any() or (times < _STRETCHED).any())
    if folds:
        return "the picture folds"
    if not strained:
        return ""
    strongest = times[np.argmax(abs(np.log(times)))]
    return f"the edge of the picture is {strongest:.2g} times as far off the axis as it looks"


def _edge_px(camera: Camera) -> FloatArray:
    """Return (8, 2) the picture's corners and the middles of its edges."""
    shares = [(x, y) for x in (0.0, 0.5, 1.0) for y in (0.0, 0.5, 1.0) if (x, y) != (0.5, 0.5)]
    edge_px: FloatArray = np.array(shares) * [camera.width_px - 1.0, camera.height_px - 1.0]
    return edge_px
