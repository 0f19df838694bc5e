"""What a draft says of the ground in one picture, by the very stages that a run has."""

from __future__ import annotations

import json
import threading
from collections import OrderedDict
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

import numpy as np

from standoff.config import Settings, build_ground, build_stage, build_watcher, settings_from
from standoff.core.classes import Role, class_ids
from standoff.core.errors import ConfigError, GroundError, StandoffError
from standoff.core.lengths import UNITS
from standoff.core.map_error import map_jacobian, picture_jacobian
from standoff.core.protocols import AnyGround, Ground
from standoff.core.types import (
    Detections,
    Frame,
    GroundMap,
    GroundPositions,
    NoCameraMotion,
    NoGroundMap,
    Tracks,
)
from standoff.drawing.ground_window import rectify
from standoff.files.yaml_text import write_yaml
from standoff.files.zone_file import write_zones
from standoff.service.pictures import jpeg_of
from standoff.service.setup.answers import GroundAnswer, TapeAnswer
from standoff.service.setup.clicked_map import clicked_map
from standoff.service.setup.draft import SAME_S, Draft, Pixel, corners_in_order
from standoff.service.setup.film import Film
from standoff.service.setup.shown import (
    camera_height,
    contours_of,
    entities_of,
    off_px,
    pixels_of,
    place_of,
    plan_of,
    ring_px,
    solid_px,
    watched_of,
    window_of,
)

_ALONE: Final = NoCameraMotion("one picture alone")
_KEPT: Final = 8
_SURE_SCORE: Final = 0.3
_PLAN_QUALITY: Final = 85
_CLICK_SIGMA_PX: Final = 1.0
"""How well a hand with a magnifier puts a point of the tape."""
_NEAR_S: Final = 10.0
"""A trial begins so much earlier, at most, to have the picture that was clicked in."""
_ANYWHERE_PX: Final = [(0.0, 0.0), (0.0, 1.0), (1.0, 1.0), (1.0, 0.0)]


@dataclass(frozen=True, slots=True, eq=False)
class Seen:
    """One picture with one draft.

    Attributes:
        frame: The picture.
        settings: What the draft says.
        ground: Its map, or why there is none.
        detections: Who is there.
        about: What the ground stage says of itself.
    """

    frame: Frame
    settings: Settings
    ground: GroundMap | NoGroundMap
    detections: Detections
    about: Mapping[str, Any]


class Sight:
    """Answers what a draft says of pictures of a film.

    Args:
        film: The film.
        base: Settings by name that the draft is laid over: those of the site's file.
        detects: Whether the detector looks at pictures; it takes a moment for each new one.
    """

    def __init__(self, film: Film, base: Mapping[str, Any], *, detects: bool = True) -> None:
        self.film = film
        self._base = base
        self._detects = detects
        self._folder = TemporaryDirectory(prefix="standoff-setup-")
        self._lock = threading.Lock()
        self._checked: tuple[str, Settings] | None = None
        self._seen: OrderedDict[tuple[float, str], Seen] = OrderedDict()

    def close(self) -> None:
        """Remove the files that the draft needed."""
        self._folder.cleanup()

    def settings(self, draft: Draft) -> Settings:
        """Return what a draft says, laid over the settings of the site's file.

        Raises:
            StandoffError: It contradicts itself, or is not complete.
        """
        missing = draft.missing()
        if missing:
            raise ConfigError(
                expected="a draft that tells the metres", found=f"still to do: {missing}", fix="complete it"
            )
        survey, zones = (Path(self._folder.name) / name for name in ("survey.yaml", "zones.geojson"))
        own = draft.settings(survey, zones)
        if draft.ground == "survey":
            write_yaml(survey, draft.survey_text(self.film.size_px))
        if draft.zones:
            write_zones(zones, draft.zones_of_site())
        return settings_from({}, "the draft", laid_over(self._base, own))

    def part_to_try(self, draft: Draft, time_s: float, lasts_s: float) -> Settings:
        """Return settings for some seconds of the film.

        A run knows the reference from the picture that was clicked in. Where that is among these seconds, or not long
        before, they begin with it; far from it the reference is looked for by itself.

        Raises:
            StandoffError: The draft contradicts itself, or is not complete.
        """
        settings = self.settings(draft)
        told_s = draft.reference.time_s if draft.ground == "reference" else time_s
        is_near = time_s - _NEAR_S <= told_s < time_s + lasts_s
        reference = settings.ground.reference
        if reference is not None and not is_near:
            unclicked = {"box_px": None, "box_time_s": None, "first_corner_px": None}
            ground = settings.ground.model_copy(update={"reference": reference.model_copy(update=unclicked)})
            settings = settings.model_copy(update={"ground": ground})
        begins_s = min(time_s, told_s) if is_near else time_s
        part = replace(settings.source, start_s=begins_s, stop_s=time_s + lasts_s)
        return settings.model_copy(update={"source": part})

    def see(self, time_s: float, draft: Draft) -> Seen:
        """Look at a picture with a draft; the last few looks are remembered.

        Raises:
            StandoffError: The draft contradicts itself, or the film cannot be read.
        """
        frame = self.film.frame(time_s)
        key = frame.time_s, json.dumps(draft.model_dump(mode="json"), sort_keys=True)
        with self._lock:
            if key in self._seen:
                self._seen.move_to_end(key)
                return self._seen[key]
            settings = self.settings(draft)
            detections = self._found(frame)
            stage = build_ground(settings, self.film.camera_prior)
            stage.prepare(self.film.size_px)
            ground = self._map(stage, frame, detections, draft)
            self._seen[key] = seen = Seen(frame, settings, ground, detections, stage.describe())
            while len(self._seen) > _KEPT:
                self._seen.popitem(last=False)
            return seen

    def _at_once(self, time_s: float, draft: Draft) -> Seen | None:
        """Look with the clicked corners as they are; None: there are none in this picture."""
        frame, reference = self.film.frame(time_s), draft.reference
        if draft.ground != "reference" or abs(reference.time_s - frame.time_s) > SAME_S:
            return None
        corners_px, _ = corners_in_order(reference.corners_px)
        # The corners are all that changes while one of them is dragged: the rest is checked once.
        elsewhere = draft.model_copy(update={"reference": reference.model_copy(update={"corners_px": _ANYWHERE_PX})})
        key = json.dumps(elsewhere.model_dump(mode="json"), sort_keys=True)
        if self._checked is None or self._checked[0] != key:
            self._checked = key, self.settings(draft)
        settings = self._checked[1]
        assert settings.ground.reference is not None
        shape, height_m = settings.ground.reference.shape(), reference.height_m or 0.0
        ground = clicked_map(corners_px, shape.corners_m, height_m, self.film.camera_prior)
        return Seen(frame, settings, ground, self._found(frame), {})

    def _found(self, frame: Frame) -> Detections:
        return self.film.found(frame) if self._detects else Detections.empty()

    def _map(self, stage: Ground, frame: Frame, detections: Detections, draft: Draft) -> GroundMap | NoGroundMap:
        """Map the picture that was clicked in, then carry on to another one if that is asked for."""
        told_s = {"reference": draft.reference.time_s, "survey": draft.survey.time_s}.get(draft.ground, frame.time_s)
        told = self.film.frame(told_s)
        if told.time_s == frame.time_s:
            return stage.update(frame, detections, _ALONE)
        stage.update(told, self._found(told), _ALONE)
        # Not clicked in this one: only what is found again counts.
        return stage.update(frame, detections, _ALONE)

    def answer(self, time_s: float, draft: Draft, *, is_dragging: bool = False) -> GroundAnswer:
        """Say everything about one picture.

        Args:
            time_s: When it is.
            draft: What was clicked and typed.
            is_dragging: Answer at once, straight from the clicks, where that can be.

        Raises:
            StandoffError: The film cannot be read.
        """
        missing = draft.missing()
        if missing:
            return GroundAnswer(time_s=time_s, found=False, missing=missing, reason="")
        try:
            rough = self._at_once(time_s, draft) if is_dragging else None
            seen = rough or self.see(time_s, draft)
        except StandoffError as error:
            return GroundAnswer(time_s=time_s, found=False, missing="", reason=str(error))
        warnings = [str(one) for one in seen.about.get("warnings", ())]
        ground = seen.ground
        unit = UNITS[draft.unit]
        tracks, positions = _placed(seen, ground)
        entities = entities_of(tracks, positions, ground)
        if isinstance(ground, NoGroundMap):
            return GroundAnswer(
                time_s=seen.frame.time_s, found=False, missing="", reason=ground.reason, warnings=warnings,
                entities=entities,
            )  # fmt: skip
        watcher = build_watcher(seen.settings, self.film.detector)
        watched = watcher.update(seen.frame, seen.detections, ground, tracks, positions)
        top_px = ground.anchors_px if draft.ground == "reference" else np.zeros((0, 2))
        return GroundAnswer(
            time_s=seen.frame.time_s,
            found=True,
            missing="",
            reason="",
            method=ground.method,
            is_rough=rough is not None,
            solid_px=solid_px(seen.settings.ground.reference, ground, top_px),
            corners_px=pixels_of(top_px),
            off_px=off_px(draft, top_px, seen.frame.time_s),
            camera_height_text=camera_height(ground, unit),
            contours=contours_of(ground, self.film.size_px, unit),
            watched=watched_of(watched),
            plan=plan_of(window_of(ground)),
            entities=entities,
            zones_px=[ring_px(ground, np.array(zone.ring_m)) for zone in draft.zones if len(zone.ring_m) >= 2],
            warnings=warnings,
        )

    def plan_jpeg(self, time_s: float, draft: Draft) -> bytes:
        """Return the ground from above, as `GroundAnswer.plan` describes it.

        Raises:
            StandoffError: There is no map.
        """
        seen = self.see(time_s, draft)
        if isinstance(seen.ground, NoGroundMap):
            raise GroundError(expected="a ground map", found=seen.ground.reason, fix="click the reference's corners")
        window = window_of(seen.ground)
        if window is None:
            raise GroundError(expected="ground in the picture", found="none", fix="choose another picture")
        onto = np.full((window.size_px[1], window.size_px[0], 3), 32, dtype=np.uint8)
        rectify(seen.frame.image, seen.ground, window, onto)
        return jpeg_of(onto, _PLAN_QUALITY)

    def tape(self, time_s: float, draft: Draft, from_px: Pixel, to_px: Pixel) -> TapeAnswer:
        """Measure a length on the ground.

        Both ends share one map, and so most of its error. First order, as in METHOD.md's chapter on errors.

        Raises:
            StandoffError: The draft contradicts itself.
        """
        ground = None if draft.missing() else self.see(time_s, draft).ground
        if ground is None or isinstance(ground, NoGroundMap):
            return TapeAnswer(length_m=None, sigma_m=None)
        ends_px = ground.undistorted(np.array([from_px, to_px]))
        ends_m, on_ground = ground.to_ground(np.array([from_px, to_px]))
        if not on_ground.all():
            return TapeAnswer(length_m=None, sigma_m=None)
        between = ends_m[1] - ends_m[0]
        length_m = float(np.linalg.norm(between))
        along = between / length_m if length_m > 0 else np.array([1.0, 0.0])
        by_map = along @ np.subtract(*map_jacobian(ground, ends_px)[::-1])
        by_clicks = along @ picture_jacobian(ground, ends_px)
        variance = by_map @ ground.covariance @ by_map + _CLICK_SIGMA_PX**2 * float((by_clicks**2).sum())
        sigma_m = float(np.sqrt(max(variance, 0.0)))
        return TapeAnswer(
            length_m=length_m,
            sigma_m=sigma_m,
            text=UNITS[draft.unit].distance(length_m, sigma_m),
            from_m=place_of(ends_m[0]),
            to_m=place_of(ends_m[1]),
        )

    def places(self, time_s: float, draft: Draft, at_px: list[Pixel]) -> list[tuple[float, float] | None]:
        """Return where points of the picture are on the ground; None where they are not on it."""
        ground = None if draft.missing() else self.see(time_s, draft).ground
        if ground is None or isinstance(ground, NoGroundMap) or not at_px:
            return [None] * len(at_px)
        points_m, on_ground = ground.to_ground(np.array(at_px))
        return [place_of(point) if valid else None for point, valid in zip(points_m, on_ground, strict=True)]


def laid_over(base: Mapping[str, Any], own: Mapping[str, Any]) -> dict[str, Any]:
    """Return settings by name with others in their place, section by section; what is None there is none."""
    merged = dict(base)
    for name, value in own.items():
        before = merged.get(name)
        merged[name] = laid_over(before, value) if isinstance(value, dict) and isinstance(before, dict) else value
    return merged


def _placed(seen: Seen, ground: AnyGround) -> tuple[Tracks, GroundPositions]:
    """Take each thing that is seen for a track of its own, and place it."""
    found = seen.detections
    found = found[(found.score >= _SURE_SCORE) & ~np.isin(found.class_id, class_ids(Role.REFERENCE))]
    count = len(found)
    tracks = Tracks(
        track_id=np.arange(count),
        xyxy_px=found.xyxy_px,
        score=found.score,
        class_id=found.class_id,
        observed=np.ones(count, dtype=np.bool_),
        age_s=np.zeros(count),
        foot_px=found.foot_px,
        foot_covariance_px2=found.foot_covariance_px2,
    )
    return tracks, build_stage("locate", seen.settings).update(seen.frame.time_s, tracks, ground)
