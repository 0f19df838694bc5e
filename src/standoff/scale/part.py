"""A part of a long film: what the detector sees in it, before somebody watches the film.

Nine tenths of a run are the detector's, and what it sees in a frame depends on that frame alone. So many machines may
look at the parts of one film side by side; whoever then watches it finds their looks in its folder and goes through all
frames in order. Tracks, map and hazards at a joint are those of a film in one piece, because they are made in one.
"""

from __future__ import annotations

from contextlib import closing
from dataclasses import asdict, dataclass
from typing import Final

import numpy as np

from standoff.clips import KeptLooks
from standoff.config import build_stage
from standoff.core.errors import StandoffError
from standoff.core.outputs import LOOKS_FOLDER
from standoff.core.protocols import EACH_ALONE, Detector
from standoff.files.whole import make_folder
from standoff.monitor import looks_name
from standoff.scale.film import FilmPlan
from standoff.stages.frames import FileSource, open_source
from standoff.stages.sinks import LooksSink

_LEAST_PARTS: Final = 2


@dataclass(frozen=True, slots=True)
class FilmPart:
    """One part of a film, to be looked at; it can be pickled.

    Attributes:
        plan: Of the film.
        start_s: First moment, seconds from the film's first picture.
        stop_s: Moment before which it ends; None: the film's end.
        first: Index of the first frame that the plan reads.
        count: How many parts the film has.
    """

    plan: FilmPlan
    start_s: float
    stop_s: float | None
    first: int
    count: int

    def look(self, cores: int = 0) -> str:
        """Keep what the detector sees in the part in the folder of the film's run.

        Args:
            cores: As of `FilmPlan.watch`.

        Returns:
            Why not, in one line; empty where all went well. Whoever watches the film looks at what is missing.
        """
        try:
            self.plan.check_machine()
            settings = self.plan.with_threads(cores)
            detector: Detector = build_stage("detect", settings)
            if not detector.describe().get(EACH_ALONE):
                return "what the detector sees in a frame depends on those before it"
            with closing(_opened(self.plan, self.start_s, self.stop_s, every=1)) as source:
                detector.prepare(source.size_px)
                self._look(source, detector)
        except (StandoffError, OSError) as error:
            return str(error)
        return ""

    def _look(self, source: FileSource, detector: Detector) -> None:
        settings, described = self.plan.settings, source.describe()
        folder = self.plan.out / LOOKS_FOLDER / looks_name(described, settings, self.plan.files)
        make_folder(folder)
        kept = KeptLooks(folder)
        sink = LooksSink(folder, kept, described, detector.describe(), settings.tables)
        step = settings.source.every * settings.detect_every
        for frame in source:
            if (frame.index - self.first) % step == 0 and kept.of(frame) is None and not detector.rests(frame):
                sink.keep(frame, detector.detect(frame))
        sink.flush()


def parts_of(plan: FilmPlan, part_s: float) -> list[FilmPart]:
    """Return the parts of a film, all of one length near `part_s`; none where it is short, or cannot be read.

    What is wrong with a film is said by whoever watches it.
    """
    if plan.settings.detections is not None:
        return []
    wanted = plan.settings.source
    try:
        if plan.is_complete():
            return []
        with closing(_opened(plan, wanted.start_s, wanted.stop_s, every=wanted.every)) as source:
            duration_s = source.describe().get("duration_s")
            first = next(iter(source)).index
    except StandoffError:
        return []
    if duration_s is None:
        return []
    stop_s = min(duration_s, duration_s if wanted.stop_s is None else wanted.stop_s)
    count = round((stop_s - wanted.start_s) / part_s)
    if count < _LEAST_PARTS:
        return []
    starts_s = np.linspace(wanted.start_s, stop_s, count, endpoint=False).tolist()
    # A film may be a little longer than it says.
    ends_s = [*starts_s[1:], wanted.stop_s]
    return [FilmPart(plan, start_s, end_s, first, count) for start_s, end_s in zip(starts_s, ends_s, strict=True)]


def _opened(plan: FilmPlan, start_s: float, stop_s: float | None, *, every: int) -> FileSource:
    wanted = asdict(plan.settings.source)
    return open_source(plan.film, **{**wanted, "start_s": start_s, "stop_s": stop_s, "every": every})
