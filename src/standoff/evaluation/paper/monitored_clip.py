"""Run the monitor on a clip and write down, frame by frame, what it said about what is really there."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from standoff.clips import Clip
from standoff.core.errors import DataError
from standoff.core.homography import BoolArray, FloatArray
from standoff.core.types import FrameResult, GroundMap, IntArray, NoGroundMap, TextArray
from standoff.evaluation.matching import NOTHING, match_boxes
from standoff.evaluation.paper.corner_order import CornerOrder
from standoff.evaluation.paper.mapped_points import MappedPoints, level_feet_px
from standoff.evaluation.paper.monitor_setup import MonitorSetup, build_monitor, settings_for
from standoff.evaluation.paper.pair_alarms import PairAlarms
from standoff.evaluation.paper.snapshots import Snapshots
from standoff.evaluation.paper.truth_detector import without_reference
from standoff.evaluation.rectification import FAILURE_PX
from standoff.evaluation.run_frames import RunFrame
from standoff.monitor import Run
from standoff.stages.frames import FileSource, open_source
from standoff.stages.ground import ReferenceShape

NOT_VISIBLE = "not visible"
NOT_DETECTED = "not detected"
NOT_BY_REFERENCE = "measured by the drone's telemetry alone"
WRONG = f"a corner is more than {FAILURE_PX:g} px off"
_ELSEWHERE = "telemetry"
"""The method of maps whose site frame is not the reference's."""


@dataclass(frozen=True, slots=True, eq=False)
class MonitoredClip:
    """What the monitor said, by frame (F), entity (E) and pair (P) of the clip.

    Attributes:
        size_px: (width, height) of the pictures.
        detected_px: (F, E, 4) boxes as detected; NaN where not detected.
        xy_m: (F, E, 2) positions, site frame; NaN where `reason` says why.
        reason: (F, E) why there is no position; empty where there is one.
        annotated_m: (F, E, 2) centres of the true boxes through the frame's own map; NaN without a map.
        true_feet: The true footprints' centres, where the picture shows them, through the frame's own map.
        level_feet: The same where the picture would show them if the ground were level.
        time_s: (F,) presentation timestamps; NaN where the run has no such frame.
        distance_m: (F, P) after the outlier filter; NaN where not measured.
        sigma_m: (F, P) standard error that is stated for it; NaN with it.
        said: (F, P) worst severity of the pair's hazards, "unknown" while it is not measured; empty without one.
        alarmed: (F, P) whether a hazard of severity warning or danger is open.
        no_map: (F,) why there is no map; empty where there is one.
        carried: (F,) whether the map comes from earlier frames while a corner of the reference is outside the picture.
        scale_m_per_px: (F,) of the map (Eq. 6); NaN without.
        corner_error_px: (F, 4) of the reference's corners; NaN without a map, or where the map tells no corners.
        ground_s: (F,) seconds spent on finding the map; NaN where nobody timed it.
        snapshots: Pictures of some frames, where there are any.
    """

    size_px: tuple[int, int]
    detected_px: FloatArray
    xy_m: FloatArray
    reason: TextArray
    annotated_m: FloatArray
    true_feet: MappedPoints
    level_feet: MappedPoints
    time_s: FloatArray
    distance_m: FloatArray
    sigma_m: FloatArray
    said: TextArray
    alarmed: BoolArray
    no_map: TextArray
    carried: BoolArray
    scale_m_per_px: FloatArray
    corner_error_px: FloatArray
    ground_s: FloatArray
    snapshots: Snapshots

    @classmethod
    def blank(cls, clip: Clip, size_px: tuple[int, int]) -> MonitoredClip:
        """Return arrays to be filled in."""
        frames, entities = clip.box_px.shape[:2]
        by_pair = frames, len(clip.pairs)
        return cls(
            size_px=size_px,
            detected_px=np.full((frames, entities, 4), np.nan),
            xy_m=np.full((frames, entities, 2), np.nan),
            reason=np.full((frames, entities), "", dtype=object),
            annotated_m=np.full((frames, entities, 2), np.nan),
            true_feet=MappedPoints.blank(frames, entities),
            level_feet=MappedPoints.blank(frames, entities),
            time_s=np.full(frames, np.nan),
            distance_m=np.full(by_pair, np.nan),
            sigma_m=np.full(by_pair, np.nan),
            said=np.full(by_pair, "", dtype=object),
            alarmed=np.zeros(by_pair, dtype=np.bool_),
            no_map=np.full(frames, "", dtype=object),
            carried=np.zeros(frames, dtype=np.bool_),
            scale_m_per_px=np.full(frames, np.nan),
            corner_error_px=np.full((frames, 4), np.nan),
            ground_s=np.full(frames, np.nan),
            snapshots=Snapshots(frames),
        )


def monitor_clip(clip: Clip, setup: MonitorSetup, on_frame: Callable[[], None] | None = None) -> MonitoredClip:
    """Run the monitor on the clip's video.

    Args:
        clip: With a reference object.
        setup: What to try.
        on_frame: Called after each frame.

    Raises:
        DataError: There is no reference object, or the video and the truth have different lengths.
        StandoffError: The video or the model cannot be used.
    """
    assert clip.reference is not None, "only such clips are watched"
    with open_clip_video(clip) as source:
        monitor = build_monitor(clip, setup, source)
        reference = settings_for(clip, setup).ground.reference
        assert reference is not None, "checked in settings_for"
        notes = Notes(clip, reference.shape(), source.size_px, true_ids=not isinstance(setup.detector, Path))
        with closing(iter(Run(source, monitor))) as results:
            for result in results:
                check_frame(clip, result.frame.index)
                notes.take(RunFrame.of_result(result))
                _keep_picture(notes.monitored, result, clip.reference.corners_px[result.frame.index])
                if on_frame is not None:
                    on_frame()
    check_frame(clip, clip.frame_count - 1, seen=notes.taken)
    return notes.monitored


def open_clip_video(clip: Clip) -> FileSource:
    """Open the clip's video.

    Raises:
        DataError: It says that it has another number of frames than the truth.
        SourceError: It cannot be read.
    """
    source = open_source(clip.video)
    if source.frame_count is not None and source.frame_count != clip.frame_count:
        source.close()
        raise _length_error(clip, f"{source.frame_count}")
    return source


def check_frame(clip: Clip, index: int, *, seen: int | None = None) -> None:
    """Raise DataError where the truth has no such frame, or the video ended with another number of frames `seen`."""
    if index >= clip.frame_count:
        raise _length_error(clip, f"at least {index + 1}")
    if seen is not None and seen != clip.frame_count:
        raise _length_error(clip, f"{seen}")


def _length_error(clip: Clip, found: str) -> DataError:
    return DataError(
        expected=f"{clip.frame_count} frames in {clip.video}, as many as in its truth",
        found=found,
        fix="render the clip again with `standoff simulate`",
    )


def _keep_picture(monitored: MonitoredClip, result: FrameResult, true_px: FloatArray) -> None:
    """Offer a frame that was filed for the report."""
    frame, ground, snapshots = result.frame.index, result.ground, monitored.snapshots
    if isinstance(ground, NoGroundMap) or monitored.no_map[frame]:
        snapshots.take_failure(result.frame, true_px, None, str(monitored.no_map[frame]))
    elif monitored.carried[frame]:
        return
    elif is_wrong(monitored.corner_error_px[frame]):
        snapshots.take_failure(result.frame, true_px, ground, WRONG)
    else:
        snapshots.take(result.frame, true_px, ground)


class Notes:
    """Takes what a run said of each frame and files it under what is really there.

    Args:
        clip: With a reference object.
        shape: Of the reference object as the monitor was told, in the site frame.
        size_px: (width, height) of the pictures.
        true_ids: Whether the tracks carry the entities' own ids; otherwise they are matched by overlap.
    """

    def __init__(self, clip: Clip, shape: ReferenceShape, size_px: tuple[int, int], *, true_ids: bool) -> None:
        assert clip.reference is not None, "only such clips are monitored"
        self.monitored = MonitoredClip.blank(clip, size_px)
        self.taken = 0
        self._clip, self._true_px = clip, clip.reference.corners_px
        self._level_px = level_feet_px(clip)
        self._in_picture = clip.reference.inside(size_px)
        self._turn = 0
        self._turning = CornerOrder(shape, clip.reference.corners_m)
        self._true_ids = true_ids
        self._said = PairAlarms(clip.pairs)

    def take(self, said: RunFrame) -> IntArray:
        """File a frame.

        Returns:
            (E,) row of each entity's track among the frame's tracks, or NOTHING.
        """
        frame, monitored = said.index, self.monitored
        self.taken += 1
        monitored.time_s[frame] = said.time_s
        monitored.ground_s[frame] = said.ground_s
        turn = self._take_map(said)
        detections = without_reference(said.detections)
        if self._true_ids:
            track_row = detection_row = self._rows_by_id(said.track_id)
        else:
            true_px, true_class = self._clip.box_px[frame], self._clip.class_id
            track_row = match_boxes(true_px, true_class, said.track_px, said.track_class_id)
            detection_row = match_boxes(true_px, true_class, detections.xyxy_px, detections.class_id)
        detected, tracked = detection_row != NOTHING, track_row != NOTHING
        monitored.detected_px[frame, detected] = detections.xyxy_px[detection_row[detected]]
        if monitored.no_map[frame] == NOT_BY_REFERENCE:
            # Distances count, places are counted from somewhere else.
            monitored.reason[frame, tracked] = NOT_BY_REFERENCE
        else:
            xy_m = self._turning.to_site(said.xy_m[track_row[tracked]], turn)
            monitored.xy_m[frame, tracked] = xy_m
            monitored.reason[frame, tracked] = said.reason[track_row[tracked]]
        monitored.reason[frame, ~tracked] = NOT_DETECTED
        monitored.reason[frame, np.isnan(self._clip.box_px[frame]).any(axis=1)] = NOT_VISIBLE
        self._take_distances(said, track_row)
        entity_of = dict(zip(said.track_id[track_row[tracked]].tolist(), np.flatnonzero(tracked).tolist(), strict=True))
        monitored.said[frame], monitored.alarmed[frame] = self._said.take(said.hazards, entity_of)
        return track_row

    def _take_map(self, said: RunFrame) -> int:
        """File what is known of the map; return the turn that brings its positions to the site frame."""
        frame, ground, monitored = said.index, said.ground, self.monitored
        true_px = self._true_px[frame]
        if isinstance(ground, NoGroundMap) or ground.method == _ELSEWHERE:
            monitored.no_map[frame] = NOT_BY_REFERENCE if isinstance(ground, GroundMap) else ground.reason
            return 0
        error_px, turn = np.full(4, np.nan), self._turn
        if len(ground.anchors_px) == len(true_px) and np.isfinite(true_px).all():
            error_px, turn = self._turning.compare(ground.anchors_px, true_px)
        self._turn = turn
        monitored.corner_error_px[frame] = error_px
        monitored.carried[frame] = ground.age_s > 0.0 and not self._in_picture[frame]
        monitored.scale_m_per_px[frame] = ground.scale_m_per_px
        boxes_px = self._clip.box_px[frame]
        centres_px = (boxes_px[:, :2] + boxes_px[:, 2:]) / 2.0
        monitored.annotated_m[frame] = self._turning.to_site(ground.to_ground(centres_px)[0], turn)
        visible = np.isfinite(boxes_px).all(axis=1)
        for points, points_px in ((monitored.true_feet, self._clip.foot_px), (monitored.level_feet, self._level_px)):
            points.take(frame, np.where(visible[:, None], points_px[frame], np.nan), ground, self._turning, turn)
        return turn

    def _take_distances(self, said: RunFrame, track_row: IntArray) -> None:
        rows = {(first, second): k for k, (first, second) in enumerate(said.pair_ids.tolist())}
        for column, ends in enumerate(self._clip.pairs):
            if (track_row[ends] != NOTHING).all():
                first, second = sorted(said.track_id[track_row[ends]].tolist())
                if (row := rows.get((first, second))) is not None:
                    self.monitored.distance_m[said.index, column] = said.distance_m[row]
                    self.monitored.sigma_m[said.index, column] = said.sigma_m[row]

    def _rows_by_id(self, track_id: IntArray) -> IntArray:
        """Return (E,) the row of each entity under its own id, or -1."""
        row_of = np.full(len(self._clip.entity_id), NOTHING)
        row_of[np.searchsorted(self._clip.entity_id, track_id)] = np.arange(len(track_id))
        return row_of


def is_wrong(corner_error_px: FloatArray) -> bool:
    """Tell whether an outline that was believed should not have been.

    Args:
        corner_error_px: (4,); NaN counts as wrong.

    >>> is_wrong(np.array([0.1, 0.2, 5.5, 0.3]))
    True
    """
    return not bool((corner_error_px <= FAILURE_PX).all())
