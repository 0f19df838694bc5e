"""Score a run on a clip with exact truth: who is found, how far off distances are, what is said."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal

import numpy as np

from standoff.clips import Clip, RunFolder, read_detections
from standoff.config import Settings, recorded_settings
from standoff.core.errors import DataError
from standoff.core.types import Severity
from standoff.evaluation.matching import NOTHING
from standoff.evaluation.paper.answers import both_radii_m
from standoff.evaluation.paper.localisation import ClassLocalisation, score_localisation
from standoff.evaluation.paper.map_only import MapScore, score_map
from standoff.evaluation.paper.monitor_setup import MonitorSetup, build_monitor, settings_for
from standoff.evaluation.paper.monitored_clip import Notes, check_frame, open_clip_video
from standoff.evaluation.paper.pairs import PairGroup, group_pairs, pair_series
from standoff.evaluation.run_and_clip import check_same_film
from standoff.evaluation.run_frames import RunFrame, read_run_frames
from standoff.monitor import Run

Pair = tuple[int, int]
Kind = Literal["near miss", "breach"]
_SEVERITY: Mapping[Kind, Severity] = MappingProxyType({"near miss": "warning", "breach": "danger"})


@dataclass(frozen=True, slots=True)
class Encounter:
    """A worker and a machine that really came close to each other, and what the monitor said of it.

    Attributes:
        kind: "breach" when the gap was negative, "near miss" when it was less than the buffer and never negative.
        names: Worker, machine.
        start_s: When the gap fell below the limit of its kind.
        end_s: When it rose above it for the last time.
        least_gap_m: The smallest gap.
        said: The worst that the monitor said of this pair; empty when it said nothing.
        said_s: When it first said so; NaN when it said nothing.
    """

    kind: Kind
    names: tuple[str, str]
    start_s: float
    end_s: float
    least_gap_m: float
    said: Severity | Literal[""]
    said_s: float

    @property
    def expected(self) -> Severity:
        """What the monitor should say."""
        return _SEVERITY[self.kind]

    @property
    def recognised(self) -> bool:
        """Whether the monitor said what it was before it was over."""
        return self.said == self.expected and self.said_s <= self.end_s


@dataclass(frozen=True, slots=True)
class ClipScore:
    """A run against the truth.

    Attributes:
        frames: Of the run.
        frames_with_map: Of these, with a ground map.
        map_only: The ground map alone, without boxes.
        classes: Recall and position errors of each class.
        pairs: Distance errors of each kind of pair.
        encounters: All true ones, in the order of time.
        false_hazards: Warnings and dangers, "worker 1 - excavator: warning", where nothing of the kind was.
    """

    frames: int
    frames_with_map: int
    map_only: MapScore
    classes: tuple[ClassLocalisation, ...]
    pairs: tuple[PairGroup, ...]
    encounters: tuple[Encounter, ...]
    false_hazards: tuple[str, ...]

    def to_dict(self) -> dict[str, Any]:
        """Return everything as JSON types; NaN stays NaN."""
        recognised = [asdict(one) | {"recognised": one.recognised} for one in self.encounters]
        return asdict(self) | {"encounters": recognised}


@dataclass(frozen=True, slots=True)
class _Said:
    """A hazard of one pair of tracks: when each severity was first said."""

    track_ids: Pair
    first_s: dict[Severity, float]


def score_run(run: Path, clip: Clip) -> ClipScore:
    """Score what a run wrote into its folder.

    Args:
        run: Folder with the record, `tracks`, `proximity`, `frames`, `detections` and `hazards`.
        clip: What the run is of, with a reference object.

    Raises:
        DataError: A file is missing or not what it should be, the run is of another film or not of all of it, or there
            is no reference object.
        ConfigError: The record's settings are of another version.
    """
    record, seen = RunFolder(run).record(), read_detections(run)
    check_same_film(record, run, clip.folder)
    witness = ClipWitness(clip, recorded_settings(record, str(run)), seen.size_px)
    for said in read_run_frames(run, seen):
        check_frame(clip, said.index)
        witness.take(said)
    return witness.score()


def score_papers_method(clip: Clip, recording: Path, on_frame: Callable[[], None] | None = None) -> ClipScore:
    """Score the paper's method, exactly as printed, on the detections of a run of the clip.

    Its edges, lines and corners within the detected box, the lens distortion left in the picture, the centre of the
    box for the entity, and its outlier filter.

    Args:
        clip: With a reference object.
        recording: The run's folder, or its table of detections.
        on_frame: Called after each frame.

    Raises:
        DataError: The clip has no reference object, or the detections are of another video.
        StandoffError: The video or the detections cannot be read.
    """
    setup = MonitorSetup("paper", recording)
    with open_clip_video(clip) as source:
        witness = ClipWitness(clip, settings_for(clip, setup), source.size_px)
        with closing(iter(Run(source, build_monitor(clip, setup, source)))) as results:
            for result in results:
                witness.take(RunFrame.of_result(result))
                if on_frame is not None:
                    on_frame()
    return witness.score()


class ClipWitness:
    """Files a run on a clip frame by frame; ask for the `score` at its end.

    Args:
        clip: The truth, with a reference object.
        settings: Of the run; its reference object is described in the clip's own site frame.
        size_px: (width, height) of the pictures.

    Raises:
        DataError: The clip or the settings are without a reference object.
    """

    def __init__(self, clip: Clip, settings: Settings, size_px: tuple[int, int]) -> None:
        if clip.reference is None or settings.ground.reference is None:
            raise DataError(
                expected="a clip and settings with a reference object", found="none", fix="choose another clip"
            )
        self._clip, self._settings, self._reference = clip, settings, clip.reference
        self._notes = Notes(clip, settings.ground.reference.shape(), size_px, true_ids=False)
        self._entities: dict[int, Counter[int]] = {}
        self._said: dict[str, _Said] = {}

    def take(self, said: RunFrame) -> None:
        """Take the next frame."""
        track_row = self._notes.take(said)
        for entity in np.flatnonzero(track_row != NOTHING).tolist():
            track = int(said.track_id[track_row[entity]])
            self._entities.setdefault(track, Counter())[entity] += 1
        for event in said.hazards:
            if event.rule == "proximity" and event.severity != "unknown":
                first, second = event.track_ids
                of_hazard = self._said.setdefault(event.hazard_id, _Said((first, second), {}))
                of_hazard.first_s.setdefault(event.severity, event.time_s)

    def score(self) -> ClipScore:
        """Compare what was taken with the truth of the whole clip.

        Raises:
            DataError: A frame of the clip was not taken.
        """
        clip, watched = self._clip, self._notes.monitored
        if self._notes.taken != clip.frame_count:
            raise DataError(
                expected=f"a run of all {clip.frame_count} frames of {clip.folder}",
                found=f"one of {self._notes.taken}",
                fix="repeat the run to its end, with every frame",
            )
        said = self._said_of_entities()
        encounters = sorted(self._encounters(said), key=lambda one: one.start_s)
        return ClipScore(
            frames=self._notes.taken,
            frames_with_map=int(np.isfinite(watched.scale_m_per_px).sum()),
            map_only=score_map(clip, watched),
            classes=score_localisation(clip, watched),
            pairs=group_pairs(pair_series(clip, watched, benchmark=False)),
            encounters=tuple(encounters),
            false_hazards=tuple(self._false_hazards(said, encounters)),
        )

    def _said_of_entities(self) -> dict[Pair, dict[Severity, float]]:
        """Return when each severity was first said of each pair of entities, or of NOTHING known."""
        said: dict[Pair, dict[Severity, float]] = {}
        for hazard in self._said.values():
            first, second = sorted(self._entity_of(track_id) for track_id in hazard.track_ids)
            of_pair = said.setdefault((first, second), {})
            for severity, time_s in hazard.first_s.items():
                of_pair[severity] = min(time_s, of_pair.get(severity, np.inf))
        return said

    def _entity_of(self, track_id: int) -> int:
        """Return the row of the entity that a track followed most of the time."""
        followed = self._entities.get(track_id)
        return NOTHING if followed is None else followed.most_common(1)[0][0]

    def _encounters(self, said: dict[Pair, dict[Severity, float]]) -> Iterator[Encounter]:
        names, hazard = self._clip.names(), self._settings.hazard
        gaps_m = self._clip.distance_m - both_radii_m(self._clip, self._settings)
        for pair, gap_m in zip(self._clip.pairs.tolist(), gaps_m.T, strict=True):
            least_m = float(np.nanmin(gap_m))
            if least_m >= hazard.buffer_m:
                continue
            kind: Kind = "breach" if least_m < 0.0 else "near miss"
            close_s = self._notes.monitored.time_s[gap_m < (0.0 if kind == "breach" else hazard.buffer_m)]
            of_pair = said.get((min(pair), max(pair)), {})
            worst = _worst(of_pair)
            yield Encounter(
                kind=kind,
                names=(names[pair[0]], names[pair[1]]),
                start_s=float(close_s[0]),
                end_s=float(close_s[-1]),
                least_gap_m=least_m,
                said=worst,
                said_s=of_pair[worst] if worst else np.nan,
            )

    def _false_hazards(self, said: dict[Pair, dict[Severity, float]], encounters: Sequence[Encounter]) -> Iterator[str]:
        names = [*self._clip.names(), "nothing"]
        expected = {one.names: one.expected for one in encounters}
        for pair, of_pair in said.items():
            # NOTHING is -1, the last of the names.
            people_first = sorted((names[entity] for entity in pair), key=lambda name: not name.startswith("worker"))
            right = expected.get((people_first[0], people_first[1]))
            worst = _worst(of_pair)
            if right is None or (worst == "danger" and right == "warning"):
                yield f"{' - '.join(people_first)}: {worst}"


def _worst(said: Mapping[Severity, float]) -> Severity | Literal[""]:
    return next((severity for severity in ("danger", "warning") if severity in said), "")
