"""Whether photographs of a board are different ones, and of one camera: one zoom, none mirrored, none cut elsewhere.

One camera that is fitted to two lies between them, and the corners may still seem to be explained. Of each photograph
alone, the board's tilt says where the focal length and the lens's axis are: with everything else as for all, these two
are fitted to its corners, which tells 1 % from each other.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np

from standoff.core.errors import GroundError
from standoff.core.homography import BoolArray, FloatArray
from standoff.stages.ground.boards import BoardView

_SAME_PX, _SAME_SHARE = 0.5, 5e-4
"""Corners of one photograph, coded anew, and of a second one by a camera and board that stand still, are so near each
other (the share is of the longer side): neither says anything new."""
_AXIS_PRIOR: Final = 0.03
"""Standard deviation of the axis's place, as a share of the longer side: a board's tilt often says little of it."""
_SIGMAS: Final = 5.0
_ZOOM_LOG, _AXIS_SHARE = 0.025, 0.015
"""What is less is left to the lens's model: photographs of good sets differ by 0.013 and, of the longer side, 0.01."""
_FEWEST_AWAY: Final = 0.25
"""At least this share of the photographs must see the axis elsewhere."""
_ROUNDS: Final = 8
_EXPLAINED: Final = 0.75
"""Of the distances between corners and where a lens puts them remain where what was done to photographs is undone."""


@dataclass(frozen=True, slots=True, eq=False)
class FittedBoards:
    """A camera, and where it saw boards.

    Attributes:
        matrix: (3, 3) of the camera.
        distortion: (5,) its Brown and Conrady coefficients.
        turns: (V, 3) rotation vectors of the boards.
        shifts: (V, 3) where their first corners are; m.
        rms_px: Of all corners.
    """

    matrix: FloatArray
    distortion: FloatArray
    turns: FloatArray
    shifts: FloatArray
    rms_px: float


@dataclass(frozen=True, slots=True, eq=False)
class _Alone:
    """What photographs say alone.

    Attributes:
        log_zoom: (V,) logarithm of the focal length, in that of all.
        axis_px: (V, 2) the axis's place, from that of all.
        sigma: (V, 3) standard errors of these three.
    """

    log_zoom: FloatArray
    axis_px: FloatArray
    sigma: FloatArray


_Fitter = Callable[[Sequence[FloatArray]], FittedBoards]


def without_repeats(views: Sequence[BoardView]) -> tuple[list[BoardView], list[BoardView]]:
    """Return views with a board of which none is another's copy, and the copies; of one size."""
    kept: list[BoardView] = []
    repeats: list[BoardView] = []
    for view in views:
        limit_px = max(_SAME_PX, _SAME_SHARE * max(view.image_size_px))
        first_last = (view.corners_px, view.corners_px[::-1, ::-1])
        copies = any(abs(one.corners_px - seen).max() < limit_px for one in kept for seen in first_last)
        (repeats if copies else kept).append(view)
    return kept, repeats


def check_one_camera(
    names: Sequence[str],
    board_m: FloatArray,
    boards_px: Sequence[FloatArray],
    image_size_px: tuple[int, int],
    fit: _Fitter,
) -> None:
    """Refuse photographs that do not agree on one camera.

    Args:
        names: V, of the photographs.
        board_m: (N, 3) corners on the board.
        boards_px: V times (rows, columns, 2) the same in the photographs.
        image_size_px: (width, height).
        fit: Fits a camera to such corners.

    Raises:
        GroundError: They do not; says which.
    """
    fitted = fit(boards_px)
    alone = _each_alone(board_m, boards_px, max(image_size_px), fitted)
    centre = float(np.median(alone.log_zoom))
    if (abs(alone.log_zoom - centre) > np.maximum(_ZOOM_LOG, _SIGMAS * alone.sigma[:, 0])).any():
        order = np.argsort(alone.log_zoom)
        cut = _cut(alone.log_zoom[order])
        shorter, longer = (", ".join(names[k] for k in sorted(part)) for part in (order[:cut], order[cut:]))
        raise GroundError(
            expected="photographs with one zoom",
            found=f"a longer focal length, likely, in {longer} than in {shorter}",
            fix="use those of one setting: no zoom, no digital zoom, no pictures that were cut or enlarged",
        )
    away = _elsewhere(alone, max(image_size_px))
    if away is not None:
        what, which = _what_was_done(boards_px, away, image_size_px, fit, _EXPLAINED * fitted.rms_px)
        raise GroundError(
            expected="photographs as one sensor saw them",
            found=f"{what} {', '.join(name for name, one in zip(names, which, strict=True) if one)}, or all others",
            fix="take them out, or undo what was done to them: mirrored, turned, cut",
        )


def _what_was_done(
    boards_px: Sequence[FloatArray], away: BoolArray, image_size_px: tuple[int, int], fit: _Fitter, limit_px: float
) -> tuple[str, BoolArray]:
    """Return what was likely done to some photographs, and (V,) to which, the fewer ones."""

    def rms_px(what: str, which: BoolArray) -> float:
        return fit(_UNDONE[what](boards_px, which, image_size_px)).rms_px

    left_px = {what: rms_px(what, away) for what in _UNDONE}
    explaining = [what for what in _UNDONE if left_px[what] < limit_px]
    if not explaining:
        return "the axis of the lens elsewhere in", away
    best = min(explaining, key=lambda what: left_px[what])
    which, least_px = away, left_px[best]
    # Of some, what they say alone was too weak to tell the side.
    for k in range(len(which)):
        other = which ^ (np.arange(len(which)) == k)
        if (other_px := rms_px(best, other)) < least_px:
            which, least_px = other, other_px
    return " or ".join(explaining), which if which.sum() * 2 <= len(which) else ~which


def _cut(rising: FloatArray) -> int:
    """Return where to cut values in two groups that are most alike in themselves (Otsu's method)."""
    return min(range(1, len(rising)), key=lambda k: k * rising[:k].var() + (len(rising) - k) * rising[k:].var())


def _each_alone(board_m: FloatArray, boards_px: Sequence[FloatArray], longer_px: float, fitted: FittedBoards) -> _Alone:
    places = []
    for corners, turn, shift in zip(boards_px, fitted.turns, fitted.shifts, strict=True):
        places.append(_alone(board_m, corners.reshape(-1, 2), longer_px, fitted, np.concatenate([turn, shift])))
    values, sigma = np.array([one for one, _ in places]), np.array([one for _, one in places])
    return _Alone(values[:, 0], values[:, 1:], sigma)


def _alone(
    board_m: FloatArray, corners_px: FloatArray, longer_px: float, fitted: FittedBoards, pose: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return (3,) log zoom and axis of one photograph and their standard errors, by Gauss and Newton's steps."""
    state = np.concatenate([pose, np.zeros(3)])
    prior = np.diag([0.0] * 7 + [(_AXIS_PRIOR * longer_px) ** -2] * 2)
    spare = 2 * len(board_m) - len(state)
    for _ in range(_ROUNDS):
        matrix = fitted.matrix.copy()
        matrix[[0, 1], [0, 1]] *= np.exp(state[6])
        matrix[:2, 2] += state[7:]
        seen_px, slopes = cv2.projectPoints(board_m, state[:3], state[3:6], matrix, fitted.distortion)
        off = corners_px.ravel() - seen_px.ravel().astype(np.float64)
        # OpenCV's columns: turn, shift, fx, fy, cx, cy, distortion.
        zoom = slopes[:, 6] * matrix[0, 0] + slopes[:, 7] * matrix[1, 1]
        slope = np.column_stack([slopes[:, :6], zoom, slopes[:, 8:10]])
        weight = spare / max(float(off @ off), np.finfo(float).tiny)
        information = weight * slope.T @ slope + prior
        state = state + np.linalg.solve(information, weight * slope.T @ off - prior @ state)
    return state[6:], np.sqrt(np.diag(np.linalg.inv(information)))[6:]


def _elsewhere(alone: _Alone, longer_px: float) -> BoolArray | None:
    """Return (V,) which photographs, the fewer ones, see the axis on the other side of all's; None where few do."""
    for axis in (0, 1):
        off_px, sigma_px = alone.axis_px[:, axis], alone.sigma[:, 1 + axis]
        sure = abs(off_px) > np.maximum(_AXIS_SHARE * longer_px, _SIGMAS * sigma_px)
        if sure.sum() >= max(2, _FEWEST_AWAY * len(sure)):
            high: BoolArray = off_px > 0
            return high if high.sum() * 2 <= len(high) else ~high
    return None


def _turned_back(boards_px: Sequence[FloatArray], which: BoolArray, image_size_px: tuple[int, int]) -> list[FloatArray]:
    last_px = np.array(image_size_px) - 1.0
    return [last_px - board if turned else board for board, turned in zip(boards_px, which, strict=True)]


def _mirrored_back(
    boards_px: Sequence[FloatArray], which: BoolArray, image_size_px: tuple[int, int]
) -> list[FloatArray]:
    # Seen from the front, a board's corners go the same way round, which a mirror turns over.
    flip = np.array([-1.0, 1.0]), np.array([image_size_px[0] - 1.0, 0.0])
    return [
        (board * flip[0] + flip[1])[:, ::-1] if mirrored else board
        for board, mirrored in zip(boards_px, which, strict=True)
    ]


_UNDONE: Final[Mapping[str, Callable[[Sequence[FloatArray], BoolArray, tuple[int, int]], list[FloatArray]]]] = {
    "mirrored": _mirrored_back,
    "upside down": _turned_back,
}
