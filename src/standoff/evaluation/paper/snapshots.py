"""Pictures for the report: a rectified view, and the reference object where it was found and where it was not."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from standoff.core.homography import FloatArray
from standoff.core.types import Frame, GroundMap, ImageArray
from standoff.drawing.ground_window import camera_up, rectify, seen_ground_m, window_around
from standoff.drawing.palette import Tone, bgr

_MOST_FAILURES = 4
_CROP_PX = (420, 300)
_VIEW_PX = (860, 560)
_MARGIN = 0.8
_QUALITY = 88
_SUBPIXEL_BITS = 4


@dataclass(frozen=True, slots=True)
class Snapshot:
    """One picture.

    Attributes:
        frame: Index.
        caption: What it shows.
        jpeg: Its bytes.
    """

    frame: int
    caption: str
    jpeg: bytes


class Snapshots:
    """Keeps one good frame, from the middle of the clip where there is one, and one of each kind of failure.

    Args:
        frame_count: Of the clip.
    """

    def __init__(self, frame_count: int) -> None:
        self._middle = frame_count // 2
        self._good: tuple[Frame, FloatArray, GroundMap] | None = None
        self.failures: dict[str, Snapshot] = {}

    def take(self, frame: Frame, true_px: FloatArray, ground: GroundMap) -> None:
        """Offer a frame whose map is right."""
        if self._good is None or self._good[0].index < self._middle:
            self._good = (frame, true_px, ground)

    def take_failure(self, frame: Frame, true_px: FloatArray, ground: GroundMap | None, reason: str) -> None:
        """Offer a frame without a map or with a wrong one."""
        if reason not in self.failures and len(self.failures) < _MOST_FAILURES:
            crop = crop_of_reference(frame, true_px, None if ground is None else ground.anchors_px)
            if crop is not None:
                self.failures[reason] = Snapshot(frame.index, reason, _jpeg(crop))

    def rectified(self) -> Snapshot | None:
        """Return the good frame as seen from above; None when no frame had a map that is right."""
        if self._good is None:
            return None
        frame, _, ground = self._good
        points_m = seen_ground_m(ground)
        if not len(points_m):
            return None
        corners_m, _ = ground.to_ground(ground.anchors_px)
        window = window_around(np.vstack([points_m, corners_m]), _VIEW_PX, camera_up(ground), margin_m=0.0)
        view = np.full((_VIEW_PX[1], _VIEW_PX[0], 3), bgr("dark"), dtype=np.uint8)
        rectify(frame.image, ground, window, view)
        _outline(view, window.to_window(corners_m), "reference")
        return Snapshot(frame.index, "rectified with the outline that was found", _jpeg(view))

    def reference(self) -> Snapshot | None:
        """Return the reference in the good frame, with its outline; None when there is no such frame."""
        if self._good is None:
            return None
        frame, true_px, ground = self._good
        crop = crop_of_reference(frame, true_px, ground.anchors_px)
        return None if crop is None else Snapshot(frame.index, "the outline that was found", _jpeg(crop))


def crop_of_reference(frame: Frame, true_px: FloatArray, found_px: FloatArray | None) -> ImageArray | None:
    """Cut the reference out of a picture and draw the true outline on it, and the found one over it.

    Args:
        frame: Its pixels are converted only where the reference is in the picture.
        true_px: (4, 2) corners.
        found_px: (4, 2) corners, or None where none were found.

    Returns:
        A picture of fixed size; None where the reference is outside.
    """
    if not np.isfinite(true_px).all():
        return None
    centre, half = true_px.mean(axis=0), np.ptp(true_px, axis=0).max() * (0.5 + _MARGIN / 2.0)
    if (centre + half < 0).any() or (centre - half > frame.size_px).any():
        return None
    scale = min(_CROP_PX) / (2.0 * half)
    to_crop = np.array([[scale, 0.0, 0.0], [0.0, scale, 0.0]])
    to_crop[:, 2] = np.array(_CROP_PX) / 2.0 - scale * centre
    crop = cv2.warpAffine(frame.image, to_crop, _CROP_PX, flags=cv2.INTER_AREA if scale < 1 else cv2.INTER_LINEAR)
    _outline(crop, true_px @ to_crop[:, :2].T + to_crop[:, 2], "worker", thickness=1)
    if found_px is not None:
        _outline(crop, found_px @ to_crop[:, :2].T + to_crop[:, 2], "danger", thickness=1)
    return np.asarray(crop, dtype=np.uint8)


def _outline(picture: ImageArray, points_px: FloatArray, tone: Tone, thickness: int = 2) -> None:
    fixed = np.round(points_px * 2**_SUBPIXEL_BITS).astype(np.int32)
    colour = bgr(tone)
    cv2.polylines(picture, [fixed], True, colour, thickness, cv2.LINE_AA, _SUBPIXEL_BITS)


def _jpeg(picture: ImageArray) -> bytes:
    _, encoded = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])
    return bytes(encoded)
