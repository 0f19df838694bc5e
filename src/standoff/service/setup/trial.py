"""Some seconds of the film, run as `standoff run` would with the draft."""

from __future__ import annotations

import threading
from collections.abc import Callable
from contextlib import closing
from math import isfinite
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

from standoff.config import Settings
from standoff.core.errors import StandoffError
from standoff.core.outputs import OUTPUTS
from standoff.monitor import RunRecord, open_run
from standoff.service.setup.answers import TrialAnswer, TrialState, TrialSummary

_OUTPUTS: Final = ("video", "report", "tracks", "proximity", "frames", "hazards")
SHOWN: Final = {"film": OUTPUTS["video"], "report": OUTPUTS["report"]}
"""What of a trial the page may show, by the name that it asks for."""
_ENDS_WITHIN_S: Final = 20.0
"""A trial that is stopped analyses the picture in hand and writes its files."""


class Trial:
    """One trial after another; a new one stops the one before it.

    Args:
        film: Of which some seconds are run.
        changed: Called from another thread when a trial has ended.
    """

    def __init__(self, film: Path, changed: Callable[[], None]) -> None:
        self._film = film
        self._changed = changed
        self._folder = TemporaryDirectory(prefix="standoff-trial-", ignore_cleanup_errors=True)
        self._lock = threading.Lock()
        self._number = 0
        self._answer = TrialAnswer(state="none")
        self._threads: list[threading.Thread] = []

    @property
    def answer(self) -> TrialAnswer:
        """How the last one goes."""
        return self._answer

    def begin(self, settings: Settings) -> TrialAnswer:
        """Begin one.

        Args:
            settings: What the draft says, for a part of the film.
        """
        settings = settings.model_copy(update={"outputs": _OUTPUTS})
        with self._lock:
            self._number += 1
            self._answer = TrialAnswer(state="running", number=self._number)
            thread = threading.Thread(target=self._run, args=(settings, self._number), daemon=True)
            self._threads = [*(one for one in self._threads if one.is_alive()), thread]
            thread.start()
            return self._answer

    def stop(self) -> None:
        """End the running one after the picture in hand."""
        with self._lock:
            self._number += 1
            self._answer = TrialAnswer(state="stopped", number=self._number)

    def close(self) -> None:
        """End the running one, and remove what trials have written when none writes any more."""
        self.stop()
        for thread in self._threads:
            thread.join(_ENDS_WITHIN_S)
        self._folder.cleanup()

    def file(self, name: str, number: int) -> Path | None:
        """Return an output of a finished trial; None where there is none."""
        path = self._out(number) / SHOWN[name]
        return path if self._answer.state == "done" and number == self._number and path.is_file() else None

    def _out(self, number: int) -> Path:
        return Path(self._folder.name) / str(number)

    def _run(self, settings: Settings, number: int) -> None:
        try:
            run = open_run(self._film, self._out(number), settings)
            expected = run.source.frame_count
            with closing(iter(run)) as results:
                for frames, _ in enumerate(results, start=1):
                    if not self._tell(number, TrialAnswer(state="running", frames=frames, frames_expected=expected)):
                        return
            record = run.record
            state: TrialState = "done" if record.status == "complete" else "failed"
            self._tell(number, TrialAnswer(state=state, message=record.message, summary=_summary(record)))
        except StandoffError as error:
            self._tell(number, TrialAnswer(state="failed", message=str(error)))
        finally:
            self._changed()

    def _tell(self, number: int, answer: TrialAnswer) -> bool:
        """Take what a trial tells, unless another has begun; return whether it is to go on."""
        with self._lock:
            if number != self._number:
                return False
            self._answer = answer.model_copy(update={"number": number})
            return True


def _summary(record: RunRecord) -> TrialSummary:
    rows = record.counts.rows
    share = record.counts.watched.share
    return TrialSummary(
        frames=rows["frames"],
        frames_with_map=rows["frames_with_map"],
        distances=rows["distances"],
        measured_distances=rows["measured_distances"],
        watched_share=share if isfinite(share) else None,
        hazards={str(name): count for name, count in record.counts.hazards.items()},
        warnings=[str(one) for one in record.about.get("warnings", ())],
    )
