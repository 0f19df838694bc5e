"""Boxes of people from the last minute, carried into the picture of now, and who of them is the same person."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from standoff.core import homography
from standoff.core.camera import Camera
from standoff.core.homography import BoolArray, FloatArray
from standoff.core.types import CameraMotion, IntArray
from standoff.stages.ground.size_fit import K1_STEP, BoxRows

_WINDOW_S = 60.0
_MOST_BOXES = 200
_CELLS = (8, 6)
"""Where boxes are kept evenly: of the fullest cell of the picture, the oldest box goes first."""

_EDGE_PX = 2.0
_SMALLEST_PX = 4.0
_FORGET_S = 3.0
_PACE_HEIGHTS, _JITTER_HEIGHTS = 1.0, 0.5
"""How far somebody gets, in heights of the box: a second, and at once."""

_MOST_MOTIONS = 2000


@dataclass(frozen=True, slots=True, eq=False)
class _Box:
    """One box: when, whose, where in the window's first picture, and the columns of `BoxRows`."""

    time_s: float
    person: int
    anchor_px: FloatArray
    cell: tuple[int, int]
    size_px: FloatArray
    centre: FloatArray
    log_size: FloatArray


class MotionChain:
    """Joins motions over changes of keyframe: how the picture moved since a first one that stays the same."""

    def __init__(self) -> None:
        self._keyframe_s: float | None = None
        self._first_to_keyframe: FloatArray = np.eye(3)
        self._first_to_image: dict[float, FloatArray] = {}

    def follow(self, time_s: float, motion: CameraMotion | None) -> FloatArray | None:
        """Return (3, 3) from the first picture to this one, None where the link to it is lost; None stands still."""
        if motion is None:
            self._first_to_image = {time_s: self._first_to_keyframe}
            return self._first_to_keyframe
        if self._keyframe_s is None:
            self._keyframe_s = motion.keyframe_s
        if motion.keyframe_s != self._keyframe_s:
            if motion.keyframe_s not in self._first_to_image:
                return None
            self._first_to_keyframe = self._first_to_image[motion.keyframe_s]
            self._first_to_image = {}
            self._keyframe_s = motion.keyframe_s
        moved = motion.keyframe_to_image @ self._first_to_keyframe
        self._first_to_image[time_s] = moved / np.linalg.norm(moved)
        if len(self._first_to_image) > _MOST_MOTIONS:
            del self._first_to_image[next(iter(self._first_to_image))]
        return self._first_to_image[time_s]


class SizeWindow:
    """Boxes of people spread over the picture and over time; begins anew where nobody knows how the camera moved.

    Args:
        camera: Likely lens.
    """

    def __init__(self, camera: Camera) -> None:
        self._cameras = tuple(camera.refocused(1.0, float(camera.distortion[0]) + step) for step in (0.0, K1_STEP))
        self._boxes: list[_Box] = []
        self._seen: dict[float, FloatArray] = {}
        self._last: dict[int, _Box] = {}
        self._people = 0

    def __len__(self) -> int:
        return len(self._boxes)

    def add(self, time_s: float, xyxy_px: FloatArray, first_to_image: FloatArray) -> None:
        """Take the boxes of the people in one picture, (N, 4); those cut off by the picture's edge are left out."""
        self._seen[time_s] = first_to_image
        self._last = {who: box for who, box in self._last.items() if time_s - box.time_s <= _FORGET_S}
        xyxy_px = xyxy_px[self._whole(xyxy_px)]
        middles_px = (xyxy_px[:, :2] + xyxy_px[:, 2:]) / 2.0
        columns = [self._columns(camera, xyxy_px) for camera in self._cameras]
        seen = np.all([np.isfinite(np.hstack(column)).all(axis=1) for column in columns], axis=0)
        anchors_px, _ = homography.apply(homography.invert(first_to_image), middles_px)
        people = self._named(time_s, middles_px, xyxy_px[:, 3] - xyxy_px[:, 1], first_to_image)
        for k in np.flatnonzero(seen & np.isfinite(anchors_px).all(axis=1)):
            box = _Box(
                time_s,
                people[k],
                anchors_px[k],
                self._cell(middles_px[k]),
                xyxy_px[k, 2:] - xyxy_px[k, :2],
                np.stack([centre[k] for centre, _ in columns]),
                np.stack([log_size[k] for _, log_size in columns]),
            )
            self._boxes.append(box)
            self._last[people[k]] = box
        self._thin(time_s)

    def rows(self, first_to_image: FloatArray) -> BoxRows:
        """Return the boxes as they are fitted, for the picture that the first one moved to."""
        times = sorted({box.time_s for box in self._boxes})
        lens = self._cameras[0].matrix
        back = homography.invert(first_to_image)
        moved = [np.linalg.inv(lens) @ self._seen[time_s] @ back @ lens for time_s in times]
        still = all(np.array_equal(self._seen[time_s], first_to_image) for time_s in times)
        _, person = np.unique([box.person for box in self._boxes], return_inverse=True)
        return BoxRows(
            centre=np.stack([box.centre for box in self._boxes], axis=1),
            log_size=np.stack([box.log_size for box in self._boxes], axis=1),
            size_px=np.stack([box.size_px for box in self._boxes]),
            person=person,
            view_of=np.zeros(len(self._boxes), np.int64) if still else self._order(times),
            now_to_view=np.eye(3)[None] if still else np.stack(moved),
        )

    def places(self) -> int:
        """Return at how many places people were seen: middles of boxes at least a box's height apart."""
        chosen: list[FloatArray] = []
        for box in self._boxes:
            if all(np.hypot(*(box.anchor_px - other)) > box.size_px[1] for other in chosen):
                chosen.append(box.anchor_px)
        return len(chosen)

    def _order(self, times: list[float]) -> IntArray:
        index = {time_s: k for k, time_s in enumerate(times)}
        return np.array([index[box.time_s] for box in self._boxes], dtype=np.int64)

    def _whole(self, xyxy_px: FloatArray) -> BoolArray:
        camera = self._cameras[0]
        far_px = np.array([camera.width_px, camera.height_px]) - 1.0 - _EDGE_PX
        inside = np.hstack([xyxy_px[:, :2] > _EDGE_PX, xyxy_px[:, 2:] < far_px])
        large = xyxy_px[:, 2:] - xyxy_px[:, :2] >= _SMALLEST_PX
        whole: BoolArray = np.all(np.hstack([inside, large]), axis=1)
        return whole

    def _columns(self, camera: Camera, xyxy_px: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return (N, 2) middles and (N, 2) log sizes in normalised coordinates, by the middles of the boxes' sides."""
        left, top, right, bottom = xyxy_px.T
        x, y = (left + right) / 2.0, (top + bottom) / 2.0
        sides = [np.column_stack(side) for side in ((left, y), (right, y), (x, top), (x, bottom))]
        focal, centre_px = np.diag(camera.matrix)[:2], camera.matrix[:2, 2]
        west, east, north, south = ((camera.undistort(side) - centre_px) / focal for side in sides)
        width, height = east[:, 0] - west[:, 0], south[:, 1] - north[:, 1]
        centre = np.column_stack([(west[:, 0] + east[:, 0]) / 2.0, (north[:, 1] + south[:, 1]) / 2.0])
        return centre, np.log(np.column_stack([width, height]))

    def _cell(self, middle_px: FloatArray) -> tuple[int, int]:
        camera = self._cameras[0]
        return int(middle_px[0] / camera.width_px * _CELLS[0]), int(middle_px[1] / camera.height_px * _CELLS[1])

    def _named(
        self, time_s: float, middles_px: FloatArray, heights_px: FloatArray, first_to_image: FloatArray
    ) -> list[int]:
        """Return a number for each person, an earlier one's where somebody was nearby a moment ago."""
        earlier = list(self._last.values())
        people = [-1] * len(middles_px)
        if earlier and len(middles_px):
            then_px, _ = homography.apply(first_to_image, np.stack([box.anchor_px for box in earlier]))
            waited_s = np.array([time_s - box.time_s for box in earlier])
            off = np.linalg.norm(middles_px[:, None] - then_px, axis=2) / heights_px[:, None]
            off = np.where(np.isfinite(off), off, np.inf) / (_JITTER_HEIGHTS + _PACE_HEIGHTS * waited_s)
            for flat in np.argsort(off, axis=None, kind="stable"):
                row, column = divmod(int(flat), len(earlier))
                if off[row, column] > 1.0:
                    break
                if people[row] < 0 and earlier[column].person not in people:
                    people[row] = earlier[column].person
        for row, person in enumerate(people):
            if person < 0:
                people[row] = self._people
                self._people += 1
        return people

    def _thin(self, time_s: float) -> None:
        self._boxes = [box for box in self._boxes if time_s - box.time_s <= _WINDOW_S]
        while len(self._boxes) > _MOST_BOXES:
            cells = [box.cell for box in self._boxes]
            fullest = max(set(cells), key=lambda cell: (cells.count(cell), cell))
            del self._boxes[cells.index(fullest)]
        kept = {box.time_s for box in self._boxes}
        self._seen = {seen_s: moved for seen_s, moved in self._seen.items() if seen_s in kept}
