"""A construction site made up for the sinks: exact geometry, drawn pictures, hazards that open and close."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import cv2
import numpy as np

from standoff.core import homography
from standoff.core.camera import Camera
from standoff.core.classes import CLASSES, Role
from standoff.core.homography import FloatArray
from standoff.core.run_counts import RunCounts
from standoff.core.types import (
    Detections,
    Frame,
    FrameResult,
    GroundMap,
    GroundPositions,
    Hazard,
    ImageArray,
    IntArray,
    Luma,
    NoCameraMotion,
    NoGroundMap,
    OpenHazards,
    Outcome,
    Proximities,
    Severity,
    Tracks,
)
from standoff.stages.frames.pictures import halved

WARNING_GAP_M = 3.0
COMPLETE = Outcome("complete")


@dataclass(frozen=True)
class FakePicture:
    """Pixels from an array."""

    image: ImageArray

    @property
    def width_px(self) -> int:
        return int(self.image.shape[1])

    @property
    def height_px(self) -> int:
        return int(self.image.shape[0])

    def bgr(self) -> ImageArray:
        return self.image

    def resized_bgr(self, width_px: int, height_px: int) -> ImageArray:
        resized: ImageArray = cv2.resize(self.image, (width_px, height_px), interpolation=cv2.INTER_LINEAR).astype(
            np.uint8, copy=False
        )
        return resized

    def gray(self) -> ImageArray:
        gray: ImageArray = cv2.cvtColor(self.image, cv2.COLOR_BGR2GRAY).astype(np.uint8, copy=False)
        return gray

    def luma(self) -> Luma:
        return self.gray()

    def halved_gray(self, times: int) -> ImageArray:
        return halved(self.gray(), times)


class FakeSite:
    """Three workers and two machines, or as many as asked for, seen from 25 m up.

    The map is lost between 2.4 s and 3.2 s; track 2 has no position between 1 s and 1.6 s; track 3 coasts
    between 3.6 s and 4.2 s.
    """

    def __init__(
        self,
        size_px: tuple[int, int] = (1280, 720),
        *,
        tracks: int = 5,
        fps: float = 25.0,
        camera: Camera | None = None,
    ) -> None:
        self.size_px, self.fps, self.camera = size_px, fps, camera
        width, height = size_px
        focal = 0.8 * width
        intrinsic = np.array([[focal, 0, (width - 1) / 2], [0, focal, (height - 1) / 2], [0, 0, 1.0]])
        if camera is not None:
            intrinsic = camera.matrix
        eye, target = np.array([-4.0, -34.0, 25.0]), np.array([0.0, 4.0, 0.0])
        forward = (target - eye) / np.linalg.norm(target - eye)
        right = np.cross(forward, [0.0, 0.0, 1.0])
        right /= np.linalg.norm(right)
        rotation = np.array([right, np.cross(forward, right), forward])
        self.projection = intrinsic @ np.column_stack([rotation, -rotation @ eye])
        self.ground_to_image = self.projection[:, [0, 1, 3]]
        self.class_id = np.array([(0, 0, 1, 0, 2, 0, 3, 0, 5, 0)[i % 10] for i in range(tracks)])
        self.track_id: IntArray = np.arange(1, tracks + 1)
        self._background = self._textured_ground()
        self._severity: dict[tuple[int, int], Severity] = {}
        self._open = OpenHazards()

    def ground(self, age_s: float = 0.0) -> GroundMap:
        anchors_m = np.array([[-1.0, -1.0], [3.0, -1.0], [3.0, 3.0], [-1.0, 3.0]])
        anchors, _ = homography.apply(self.ground_to_image, anchors_m)
        return GroundMap(
            image_to_ground=homography.invert(self.ground_to_image),
            covariance=np.eye(9) * 1e-12,
            image_size_px=self.size_px,
            method="reference:refined",
            scale_m_per_px=0.03,
            anchors_px=anchors if self.camera is None else self.camera.distort(anchors),
            camera=self.camera,
            age_s=age_s,
            frame_stated=True,
        )

    def xy_m(self, time_s: float) -> FloatArray:
        places = []
        for i, class_id in enumerate(self.class_id.tolist()):
            centre = np.array([((-13, 13, -2, 24, 17)[i % 5]), (-4, 2, 13, 16, 19)[i % 5] + 9.0 * (i // 5)])
            turn, reach = (0.55, 9.0) if CLASSES[class_id].role is Role.PERSON else (0.3, 3.0)
            phase = 2.4 * i + 0.6 + turn * time_s
            places.append(centre + reach * np.array([np.cos(phase), 0.7 * np.sin(phase)]))
        return np.array(places).reshape(-1, 2)

    def results(self, frames: int = 150) -> Iterator[FrameResult]:
        for index in range(frames):
            yield self.result(index, last=index == frames - 1)

    def result(self, index: int, *, last: bool = False, time_s: float | None = None) -> FrameResult:
        time_s = index / self.fps if time_s is None else time_s
        xy, boxes, image = self.xy_m(time_s), [], self._background.copy()
        for place, class_id in sorted(zip(xy.tolist(), self.class_id.tolist(), strict=True), key=lambda e: -e[0][1]):
            self._draw_entity(image, np.array(place), class_id)
        boxes = [self._box(place, class_id) for place, class_id in zip(xy, self.class_id.tolist(), strict=True)]
        lost = 2.4 <= time_s < 3.2
        ground = NoGroundMap("reference hidden & <not> found") if lost else self.ground(0.4 if index % 50 > 40 else 0.0)
        observed = np.array([not (i == 3 and 3.6 <= time_s < 4.2) for i in self.track_id], dtype=bool)
        tracks = Tracks(
            track_id=self.track_id,
            xyxy_px=np.array(boxes),
            score=np.full(len(xy), 0.8),
            class_id=self.class_id,
            observed=observed,
            age_s=np.full(len(xy), time_s),
        )
        positions = self._positions(time_s, xy, lost)
        proximities = self._proximities(positions)
        hazards = self._hazards(time_s, proximities, last)
        self._open = self._open.after(hazards)
        return FrameResult(
            frame=Frame("site", index, time_s, FakePicture(image)),
            detections=Detections(np.array(boxes), np.full(len(xy), 0.8), self.class_id),
            detected=True,
            motion=NoCameraMotion("not estimated"),
            ground=ground,
            tracks=tracks,
            positions=positions,
            proximities=proximities,
            hazards=hazards,
            stage_ms={"detect": 20.0, "ground": 2.0 + index % 3, "track": 0.3},
            open_hazards=self._open,
        )

    def _positions(self, time_s: float, xy: FloatArray, lost: bool) -> GroundPositions:
        valid = np.array([not lost and not (i == 2 and 1.0 <= time_s < 1.6) for i in self.track_id], dtype=bool)
        nan = ~valid
        step = (self.xy_m(time_s + 0.01) - xy) / 0.01
        covariance = np.tile(np.eye(4) * 0.2**2, (len(xy), 1, 1))
        xy, covariance = xy.copy(), covariance.copy()
        xy[nan], step[nan], covariance[nan] = np.nan, np.nan, np.nan
        return GroundPositions(
            track_id=self.track_id,
            class_id=self.class_id,
            xy_m=xy,
            velocity_mps=step,
            state_covariance=covariance,
            map_factor_m=np.where(nan[:, None, None], np.nan, np.zeros((len(xy), 2, 10))),
            predicted=np.zeros(len(xy), dtype=bool),
            standing_s=np.zeros(len(xy)),
            radius_m=np.array([CLASSES[c].action_radius_m for c in self.class_id.tolist()]),
            valid=valid,
            reason=np.where(valid, "", "no ground map" if lost else "outside the trusted area").astype(object),
        )

    def _proximities(self, positions: GroundPositions) -> Proximities:
        person = np.array([CLASSES[c].role is Role.PERSON for c in self.class_id.tolist()], dtype=bool)
        i, j = (k for k in np.triu_indices(len(person), 1))
        mixed = person[i] != person[j]
        i, j = i[mixed], j[mixed]
        apart = positions.xy_m[i] - positions.xy_m[j]
        distance = np.linalg.norm(apart, axis=1)
        gap = distance - positions.radius_m[i] - positions.radius_m[j]
        closing = -(apart * (positions.velocity_mps[i] - positions.velocity_mps[j])).sum(axis=1) / distance
        with np.errstate(divide="ignore", invalid="ignore"):
            contact = np.where(gap < 0, 0.0, np.where(closing > 0, gap / closing, np.inf))
        contact[np.isnan(distance)] = np.nan
        return Proximities(
            track_a=self.track_id[i],
            track_b=self.track_id[j],
            distance_m=distance,
            gap_m=gap,
            sigma_m=np.where(np.isnan(distance), np.nan, 0.28),
            closing_mps=closing,
            time_to_contact_s=contact,
            filtered=np.zeros(len(i), dtype=bool),
        )

    def _hazards(self, time_s: float, pairs: Proximities, last: bool) -> tuple[Hazard, ...]:
        events = []
        rows = zip(pairs.track_a.tolist(), pairs.track_b.tolist(), pairs.distance_m, pairs.gap_m, strict=True)
        for a, b, distance, gap in rows:
            before = self._severity.get((a, b))
            now: Severity | None = "danger" if gap < 0 else "warning" if gap < WARNING_GAP_M else None
            if np.isnan(gap):
                now = before
            if last:
                now = None
            if now == before and not (np.isnan(gap) and before):
                continue
            phase = (
                "closed" if now is None else "opened" if before is None else "unknown" if np.isnan(gap) else "updated"
            )
            severity = now or before or "unknown"
            identity, sigma = f"H{a:02d}{b:02d}", float("nan") if np.isnan(gap) else 0.28
            events.append(
                Hazard(identity, "proximity", severity, phase, (a, b), time_s, float(distance), float(gap), sigma)  # type: ignore[arg-type]
            )
            self._severity.pop((a, b), None)
            if now is not None:
                self._severity[a, b] = now
        return tuple(events)

    def _cuboid_px(self, place: FloatArray, class_id: int) -> FloatArray:
        site_class = CLASSES[class_id]
        half_length, half_width = max(site_class.length_m, 0.6) / 2, max(site_class.width_m, 0.5) / 2
        corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (0, 1)], dtype=float)
        corners *= [half_length, half_width, site_class.height_m]
        corners[:, :2] += place
        seen = np.column_stack([corners, np.ones(8)]) @ self.projection.T
        pixels: FloatArray = seen[:, :2] / seen[:, 2:]
        return pixels if self.camera is None else self.camera.distort(pixels)

    def _box(self, place: FloatArray, class_id: int) -> list[float]:
        pixels = self._cuboid_px(place, class_id)
        return [*pixels.min(axis=0).tolist(), *pixels.max(axis=0).tolist()]

    def _draw_entity(self, image: ImageArray, place: FloatArray, class_id: int) -> None:
        pixels = np.round(self._cuboid_px(place, class_id)).astype(np.int32)
        colour = (40, 120, 235) if CLASSES[class_id].role is Role.PERSON else (40, 190, 235)
        cv2.fillConvexPoly(image, cv2.convexHull(pixels), colour, cv2.LINE_AA)
        cv2.fillConvexPoly(image, cv2.convexHull(pixels[1::2].copy()), tuple(c * 0.75 for c in colour), cv2.LINE_AA)

    def _textured_ground(self) -> ImageArray:
        rng = np.random.default_rng(7)
        size, per_m = 900, 9.0
        texture = np.full((size, size, 3), (118, 140, 158), dtype=np.float64)
        for cells, strength in ((6, 22), (30, 14), (160, 12)):
            noise = rng.normal(size=(cells, cells)).astype(np.float32)
            texture += strength * cv2.resize(noise, (size, size), interpolation=cv2.INTER_CUBIC)[:, :, None]
        ground = np.clip(texture, 0, 255).astype(np.uint8)
        for shift in (0, 18):
            cv2.ellipse(ground, (450 + shift, 430), (260, 180), 20, 0, 360, (88, 104, 118), 7, cv2.LINE_AA)
        to_metres = np.array([[1 / per_m, 0, -50.0], [0, -1 / per_m, 50.0], [0, 0, 1]])
        corners = homography.apply(np.linalg.inv(to_metres), np.array([[-1, -1], [3, -1], [3, 3], [-1, 3.0]]))[0]
        cv2.fillConvexPoly(ground, np.round(corners).astype(np.int32), (205, 205, 200), cv2.LINE_AA)
        picture = cv2.warpPerspective(
            ground, self.ground_to_image @ to_metres, self.size_px, borderMode=cv2.BORDER_REFLECT
        )
        return np.asarray(picture, dtype=np.uint8)


def quiet(result: FrameResult) -> FrameResult:
    """Return the result as if no hazard were open."""
    return replace(result, hazards=(), open_hazards=OpenHazards())


def ended(results: Iterable[FrameResult], outcome: Outcome = COMPLETE) -> Outcome:
    """Return an outcome that has counted these results."""
    counts = RunCounts()
    for result in results:
        counts.add(result)
    counts.add_events(outcome.hazards)
    return replace(outcome, counts=counts)
