"""Follow entities from frame to frame."""

from __future__ import annotations

import math

import numpy as np

from standoff.core import protocols
from standoff.core.assignment import assign
from standoff.core.boxes import overlaps, widen
from standoff.core.classes import CLASSES
from standoff.core.homography import BoolArray, FloatArray
from standoff.core.picture_step import picture_step
from standoff.core.protocols import AnyGround, AnyMotion
from standoff.core.roles import REFERENCE_ROLE, ROLE_OF_CLASS
from standoff.core.types import CameraMotion, Detections, IntArray, NoCameraMotion, Tracks
from standoff.stages.track import foot, reach
from standoff.stages.track import motion as box_motion
from standoff.stages.track.carry import carry
from standoff.stages.track.params import TrackParams

_ROW = np.dtype(
    [
        *box_motion.MOTION_FIELDS,
        *foot.FOOT_FIELDS,
        *reach.PLACE_FIELDS,
        ("track_id", np.int64),
        ("score", np.float64),
        ("class_votes", np.float64, (len(CLASSES),)),
        ("confirmed", np.bool_),
        ("hits", np.int64),
        ("started_s", np.float64),
        ("seen_s", np.float64),
        ("sure_s", np.float64),
    ]
)
_OTHER_CLASS = 0.7
_TIME_ROUNDING_S = 1e-6
_LEAST_CLOSENESS = 1e-6


class Tracker(protocols.Tracker):
    """Turn detections, frame by frame, into tracks of one stream.

    Sure detections are assigned to tracks first, then unsure ones to the tracks that are left: a
    half-hidden person is still a person where one was just seen (ByteTrack). Beyond ByteTrack, a track
    leaves a sure detection alone that fits it less well than an unsure one, which keeps it from jumping
    to a neighbour while its own person is half hidden, and unsure detections alone carry it for
    `max_unsure_s` only, so that clutter does not keep a ghost alive.

    A track is reported once it is confirmed, and coasts on its predicted box, marked as not observed,
    while the detector rests and for `max_coast_s` of misses. Missed for longer it is silent but not
    forgotten; after `max_lost_s` it ends.

    Where looks are so far apart that boxes of one entity no longer overlap, a sure detection continues the track that
    can have gone there over the ground, and a new one is reported at once: a second look would come too late.

    Persons continue as persons, machines as machines; among machines the class may flicker, and the
    track's class is the one with the largest sum of scores so far. Reference objects are not tracked.

    Where the motion of the camera is known, boxes are predicted over the ground and carried along with its picture, so
    that a turning drone loses nobody; where it is not, the picture is taken to stand still.

    A ground point that the detector gives is smoothed inside the box and goes along with it.

    Times are presentation timestamps in seconds; the steps between them may vary, and may be zero.

    Args:
        params: Settings; None takes the defaults.

    Source:
        Zhang et al., ByteTrack: Multi-Object Tracking by Associating Every Detection Box (2022),
        algorithm 1.

    >>> tracker = Tracker()
    >>> box = np.array([[10.0, 10.0, 20.0, 40.0]])
    >>> still = NoCameraMotion("not estimated")
    >>> from standoff.core.types import NoGroundMap
    >>> unmapped = NoGroundMap("no reference")
    >>> tracker.update(0.0, Detections(box, np.array([0.9]), np.array([0])), still, unmapped).track_id
    array([1])
    >>> tracker.coast(0.1, still).observed
    array([False])
    """

    def __init__(self, params: TrackParams | None = None) -> None:
        self._params = params or TrackParams()
        self._next_id = 1
        self.reset()

    def reset(self) -> None:
        """Forget all tracks and the time: a new stream, or a cut, follows.

        Ids go on where they were, so that one object never gives two entities the same id.
        """
        self._rows = np.zeros(0, _ROW)
        self._time_s = -math.inf
        self._motion: AnyMotion = NoCameraMotion("no frame before")
        self._looked_s = -math.inf

    def update(self, time_s: float, detections: Detections, motion: AnyMotion, ground: AnyGround) -> Tracks:
        """Take in what the detector saw.

        Args:
            time_s: Presentation timestamp, not before the previous one.
            detections: May be empty: the detector looked and saw nothing.
            motion: How the picture of the ground moved, of this frame.
            ground: The frame's map, or why there is none.

        Returns:
            The confirmed tracks in the order of their ids, coasting ones included. Boxes are filtered,
            which on real detections places feet better than the detector's own boxes do.

        Raises:
            ValueError: The time is not finite or went backwards.
        """
        self._advance(time_s, motion)
        detections = self._relevant(detections)
        places_m = reach.standing_m(detections, ground)
        unclaimed = self._associate(detections, places_m, ground)
        self._end_lost()
        new = unclaimed & (detections.score >= self._params.start_score)
        if new.any():
            self._start(detections[new], places_m[new], ground)
        self._looked_s = time_s
        return self._report()

    def coast(self, time_s: float, motion: AnyMotion) -> Tracks:
        """Predict all tracks to a frame on which the detector rested.

        Nobody looked, so no track ends and none is dropped from the report: a rest is not a miss.

        Args:
            time_s: Presentation timestamp, not before the previous one.
            motion: How the picture of the ground moved, of this frame.

        Returns:
            The confirmed tracks in the order of their ids, none of them observed.

        Raises:
            ValueError: The time is not finite or went backwards.
        """
        self._advance(time_s, motion)
        return self._report(rested=True)

    def _advance(self, time_s: float, motion: AnyMotion) -> None:
        if not math.isfinite(time_s) or time_s < self._time_s:
            raise ValueError(
                f"expected a time not before {self._time_s} s, found {time_s} s; call reset() when a new stream begins"
            )
        if len(self._rows):
            box_motion.predict(self._rows, time_s - self._time_s, self._params)
            foot.forget(self._rows, time_s - self._time_s, self._params.foot_memory_s)
            step = picture_step(self._motion, self._time_s, motion)
            if step is not None and isinstance(motion, CameraMotion):
                carry(self._rows, step, motion.camera)
        self._time_s, self._motion = time_s, motion

    @property
    def _looks_are_rare(self) -> bool:
        return self._time_s - self._looked_s > self._params.rare_look_s

    def _relevant(self, detections: Detections) -> Detections:
        """Drop reference objects, hopeless scores, and a machine's second box under another class."""
        surest_first = np.argsort(-detections.score, kind="stable")
        wanted = (ROLE_OF_CLASS[detections.class_id] != REFERENCE_ROLE) & (detections.score >= self._params.low_score)
        detections = detections[surest_first[wanted[surest_first]]]
        class_id, role = detections.class_id, ROLE_OF_CLASS[detections.class_id]
        same_thing = (role[:, None] == role) & (class_id[:, None] != class_id)
        if same_thing.any():
            same_thing &= overlaps(detections.xyxy_px, detections.xyxy_px) >= self._params.duplicate_overlap
            second = np.triu(same_thing, k=1).any(axis=0)
            detections = detections[~second] if second.any() else detections
        return detections

    def _associate(self, detections: Detections, places_m: FloatArray, ground: AnyGround) -> BoolArray:
        """Continue tracks with detections; return which detections (N,) are left over."""
        unclaimed = np.ones(len(detections), dtype=np.bool_)
        if not len(self._rows) or not len(detections):
            return unclaimed
        sure = detections.score >= self._params.high_score
        similarity = self._similarity(detections)
        possible_unsure = ~sure & (similarity >= self._params.min_overlap_unsure)
        best_unsure = np.where(possible_unsure, similarity, 0.0).max(axis=1, keepdims=True)
        similarity[sure & (similarity < best_unsure)] = 0.0
        closeness = self._closeness(detections, places_m, ground)
        confirmed = self._rows["confirmed"].copy()
        waiting = np.ones(len(self._rows), dtype=np.bool_)
        for tracks, candidates, likeness, at_least in (
            (confirmed, sure, similarity, self._params.min_overlap),
            (confirmed, ~sure, similarity, self._params.min_overlap_unsure),
            (~confirmed, np.ones_like(sure), similarity, self._params.min_overlap),
            (np.ones_like(confirmed), sure, closeness, _LEAST_CLOSENESS),
        ):
            rows, columns = np.flatnonzero(tracks & waiting), np.flatnonzero(candidates & unclaimed)
            if not len(rows) or not len(columns):
                continue
            first, second = assign(likeness[np.ix_(rows, columns)], at_least)
            rows, columns = rows[first], columns[second]
            self._continue(rows, detections, columns)
            reach.correct(self._rows, rows, places_m[columns], ground, self._time_s)
            waiting[rows] = False
            unclaimed[columns] = False
        return unclaimed

    def _similarity(self, detections: Detections) -> FloatArray:
        """Return (M, N) overlap of tracks with detections; less for another class, 0 for another role."""
        margin = self._params.margin
        predicted_px = box_motion.to_edges(self._rows["box"])
        overlap = overlaps(widen(predicted_px, margin), widen(detections.xyxy_px, margin))
        return self._agreement(detections) * overlap

    def _closeness(self, detections: Detections, places_m: FloatArray, ground: AnyGround) -> FloatArray:
        """Return (M, N) closeness on the ground of the tracks that the last look saw; 0 for another role."""
        if not self._looks_are_rare:
            return np.zeros((len(self._rows), len(detections)))
        class_id = self._class_id(self._rows)
        closeness = reach.closeness(self._rows, class_id, places_m, ground, self._time_s, self._params)
        just_seen: BoolArray = self._rows["seen_s"] == self._looked_s
        likeness: FloatArray = self._agreement(detections) * closeness * just_seen[:, None]
        return likeness

    def _agreement(self, detections: Detections) -> FloatArray:
        """Return (M, N) how well classes agree."""
        class_id = self._class_id(self._rows)[:, None]
        agreement: FloatArray = np.where(class_id == detections.class_id, 1.0, _OTHER_CLASS)
        agreement *= ROLE_OF_CLASS[class_id] == ROLE_OF_CLASS[detections.class_id]
        return agreement

    def _continue(self, which: IntArray, detections: Detections, by: IntArray) -> None:
        """Take detections `by` (K,) into tracks `which` (K,)."""
        rows, score = self._rows, detections.score[by]
        box_motion.correct(rows, which, box_motion.to_centre(detections.xyxy_px[by]), self._params)
        foot.correct(rows, which, detections.foot_px[by], detections.foot_covariance_px2[by])
        rows["score"][which] = score
        rows["class_votes"][which, detections.class_id[by]] += score
        rows["hits"][which] += 1
        rows["confirmed"][which] |= rows["hits"][which] >= self._params.confirm_hits
        rows["seen_s"][which] = self._time_s
        rows["sure_s"][which[score >= self._params.high_score]] = self._time_s

    def _end_lost(self) -> None:
        unseen_s = self._time_s - self._rows["seen_s"]
        unsure_s = self._time_s - self._rows["sure_s"]
        longest_s = max(self._params.max_lost_s, self._params.max_coast_s)
        patience_s = np.where(self._rows["confirmed"], longest_s, 0.0) + _TIME_ROUNDING_S
        self._rows = self._rows[(unseen_s <= patience_s) & (unsure_s <= self._params.max_unsure_s + _TIME_ROUNDING_S)]

    def _start(self, detections: Detections, places_m: FloatArray, ground: AnyGround) -> None:
        count = len(detections)
        rows = np.zeros(count, _ROW)
        box_motion.start(rows, box_motion.to_centre(detections.xyxy_px), self._params)
        foot.start(rows)
        foot.correct(rows, np.arange(count), detections.foot_px, detections.foot_covariance_px2)
        reach.start(rows)
        reach.correct(rows, np.arange(count), places_m, ground, self._time_s)
        rows["track_id"] = np.arange(self._next_id, self._next_id + count)
        rows["score"] = detections.score
        rows["class_votes"][np.arange(count), detections.class_id] = detections.score
        rows["hits"] = 1
        # Where looks are rare, a second one would come too late.
        rows["confirmed"] = self._looks_are_rare or self._params.confirm_hits == 1
        rows["started_s"] = rows["seen_s"] = rows["sure_s"] = self._time_s
        self._next_id += count
        self._rows = np.concatenate([self._rows, rows])

    @staticmethod
    def _class_id(rows: box_motion.MotionArray) -> IntArray:
        class_id: IntArray = rows["class_votes"].argmax(axis=1)
        return class_id

    def _report(self, *, rested: bool = False) -> Tracks:
        overdue_s = self._looked_s - self._rows["seen_s"]
        rows = self._rows[self._rows["confirmed"] & (overdue_s <= self._params.max_coast_s + _TIME_ROUNDING_S)]
        foot_px, foot_covariance_px2 = foot.in_picture(rows)
        return Tracks(
            track_id=rows["track_id"],
            xyxy_px=box_motion.to_edges(rows["box"]),
            score=rows["score"],
            class_id=self._class_id(rows),
            observed=(rows["seen_s"] == self._time_s) & (not rested),
            age_s=self._time_s - rows["started_s"],
            foot_px=foot_px,
            foot_covariance_px2=foot_covariance_px2,
        )
