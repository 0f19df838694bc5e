"""The paper's lab test on a clip that shows a checkerboard (section 5.2, Tables 4 and 5, Fig. 8)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from standoff.clips import Clip, TrueBoard
from standoff.core.camera import Camera
from standoff.core.homography import FloatArray
from standoff.evaluation.checkerboard import CheckerboardResult, evaluate_views
from standoff.evaluation.paper.monitored_clip import check_frame, open_clip_video
from standoff.evaluation.rectification import FAILURE_PX
from standoff.stages.ground import BoardView, find_corners, load_camera

NOT_FOUND = "no whole board found"


@dataclass(frozen=True, slots=True, eq=False)
class BoardScore:
    """Accuracies (Eq. 7) in per cent, NaN where no board was found; by frame (F) or over all measured frames.

    Attributes:
        corners: Of the board.
        frames: Of the clip.
        measured: Of these, with a whole board that could be measured.
        before: (F,) before rectification.
        after: (F,) after.
        before_percent: Over all.
        after_percent: Over all.
        after_pose_percent: With the camera's lens and pose, beyond the paper.
        exact_before_percent: From the truth's own corners: what is left of perspective.
        exact_after_percent: From the truth's own corners: what is left of the lens.
        worst_frame: With the lowest accuracy before; -1 without.
        best_frame: With the highest accuracy before; -1 without.
        corner_rmse_px: Of the found corners; NaN without.
        misplaced: Frames in which a found corner is more than 5 px off.
    """

    corners: int
    frames: int
    measured: int
    before: FloatArray
    after: FloatArray
    before_percent: float
    after_percent: float
    after_pose_percent: float
    exact_before_percent: float
    exact_after_percent: float
    worst_frame: int
    best_frame: int
    corner_rmse_px: float
    misplaced: int


def view_board(clip: Clip, board: TrueBoard, on_frame: Callable[[], None] | None = None) -> list[BoardView]:
    """Look for the board in every frame of the clip's video.

    Raises:
        DataError: The video and the truth have different lengths.
        SourceError: The video cannot be read.
    """
    views = []
    with open_clip_video(clip) as source:
        for frame in source:
            check_frame(clip, frame.index)
            corners_px = find_corners(frame.picture.gray(), (board.side, board.side))
            in_order_px = as_in_truth(corners_px, board.corners_px[frame.index]) if corners_px.size else corners_px
            views.append(BoardView(_name(frame.index), source.size_px, in_order_px))
            if on_frame is not None:
                on_frame()
    check_frame(clip, clip.frame_count - 1, seen=len(views))
    return views


def score_board(clip: Clip, board: TrueBoard, views: list[BoardView]) -> BoardScore:
    """Repeat the lab test on the found corners and on the true ones."""
    frames = len(views)
    camera = load_camera(clip.camera_file)
    size_px = views[0].image_size_px
    exact = [
        BoardView(_name(index), size_px, corners_px)
        for index, corners_px in enumerate(board.corners_px)
        if np.isfinite(corners_px).all()
    ]
    found, found_by_pose, of_truth = _result(views, board), _result(views, board, camera), _result(exact, board)
    before, after = np.full(frames, np.nan), np.full(frames, np.nan)
    for view in found.views if found else ():
        index = int(view.name.split()[-1])
        before[index], after[index] = view.before_percent, view.after_percent
    none, error_px = float("nan"), _corner_errors_px(views, board)
    return BoardScore(
        corners=board.side**2,
        frames=frames,
        measured=int(np.isfinite(after).sum()),
        before=before,
        after=after,
        before_percent=found.before_percent if found else none,
        after_percent=found.after_percent if found else none,
        after_pose_percent=found_by_pose.after_pose_percent if found_by_pose else none,
        exact_before_percent=of_truth.before_percent if of_truth else none,
        exact_after_percent=of_truth.after_percent if of_truth else none,
        worst_frame=int(np.nanargmin(before)) if found else -1,
        best_frame=int(np.nanargmax(before)) if found else -1,
        corner_rmse_px=float(np.sqrt(np.mean(error_px**2))) if error_px.size else none,
        misplaced=int((error_px > FAILURE_PX).any(axis=1).sum()),
    )


def as_in_truth(corners_px: FloatArray, true_px: FloatArray) -> FloatArray:
    """Turn a grid of corners so that it runs as the true one does.

    A finder begins where it likes. The figures before rectification depend on which side of the first square gives
    the scale, and on a board as long as wide nothing else tells the sides apart.

    Args:
        corners_px: (side, side, 2) as found.
        true_px: (side, side, 2).

    >>> true_px = np.array([[[0.0, 0.0], [5.0, 0.0]], [[0.0, 9.0], [5.0, 9.0]]])
    >>> bool((as_in_truth(true_px.transpose(1, 0, 2)[::-1], true_px) == true_px).all())
    True
    """
    sides = (corners_px, corners_px.transpose(1, 0, 2))
    ways = [way for side in sides for way in (side, side[::-1], side[:, ::-1], side[::-1, ::-1])]
    return min(ways, key=lambda way: float(np.nansum((way - true_px) ** 2)))


def _name(index: int) -> str:
    return f"frame {index}"


def _result(views: list[BoardView], board: TrueBoard, camera: Camera | None = None) -> CheckerboardResult | None:
    if not any(view.found for view in views):
        return None
    return evaluate_views(views, (board.side, board.side), board.square_m, camera)


def _corner_errors_px(views: list[BoardView], board: TrueBoard) -> FloatArray:
    """Return (V, side * side) of the views in which a board was found."""
    pairs = zip(views, board.corners_px, strict=True)
    errors = [np.linalg.norm(view.corners_px - true_px, axis=2).ravel() for view, true_px in pairs if view.found]
    return np.array(errors).reshape(len(errors), board.side**2)
