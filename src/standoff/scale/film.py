"""One film to be watched: all that whoever watches it has to know, on whatever machine that is."""

from __future__ import annotations

import socket
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from standoff import __version__
from standoff.config import Settings, named_files
from standoff.core.errors import ConfigError, StandoffError
from standoff.core.outputs import LOOKS_FOLDER, OUTPUTS, RECORD_FILE
from standoff.files.fingerprint import digests
from standoff.files.json_text import read_json
from standoff.monitor import open_run, other_film, other_means
from standoff.scale.result import FilmResult, read_result


@dataclass(frozen=True, slots=True)
class FilmPlan:
    """One film to be watched; it can be pickled, and sent to another machine that sees the same files.

    Attributes:
        film: Video file.
        out: Folder of its run.
        settings: What to run.
        files: SHA-256 of each file that the settings name, as of the machine that planned.
        overwrites: Replace a complete run of other settings.
        version: Of the standoff that planned.
    """

    film: Path
    out: Path
    settings: Settings
    files: Mapping[str, str]
    overwrites: bool = False
    version: str = __version__

    def watch(self, cores: int = 0) -> FilmResult:
        """Watch the film, unless that was done before; what is wrong with film or folder is in the result.

        A run in the folder that was stopped, was killed or lost an output is done again; what the detector saw in it is
        taken where it was the same run.

        Args:
            cores: So many threads compute the detector, unless the settings say how many; 0: all there are.
        """
        try:
            self.check_machine()
            if self._is_finished():
                return read_result(self.film, self.out, is_new=False)
            is_there = any((self.out / name).exists() for name in (RECORD_FILE, LOOKS_FOLDER))
            run = open_run(self.film, self.out, self.with_threads(cores), overwrite=is_there, resume=True)
            for _ in run:
                pass
            # As the run says it: a full disk may have kept its record from being whole.
            if run.record.status != "complete":
                return FilmResult(self.film, self.out, "failed", run.record.message)
            return read_result(self.film, self.out)
        except StandoffError as error:
            return FilmResult(self.film, self.out, "failed", str(error))
        except OSError as error:
            return FilmResult(self.film, self.out, "failed", error.strerror or str(error))

    def is_complete(self) -> bool:
        """Tell whether its folder holds a run that came to its end, whatever its settings.

        Raises:
            DataError: Its record is broken.
        """
        return self._record_of_complete_run() is not None

    def refuse_other_run(self) -> None:
        """Refuse a folder with a complete run of other settings, files or version, unless that is to be replaced.

        Raises:
            ConfigError: There is one.
            DataError: Its record is broken.
        """
        record = self._record_of_complete_run()
        other = "" if self.overwrites or record is None else self._other_means(record)
        if other:
            raise self._refused(other)

    def _is_finished(self) -> bool:
        """Tell whether its folder holds a whole run of this very film, by the same means.

        Raises:
            StandoffError: It holds a complete run of another film or by other means, which is not to be replaced; or
                the film cannot be read.
        """
        record = self._record_of_complete_run()
        if record is None:
            return False
        other = self._other_means(record) or other_film(record, self.film, self.settings)
        if other and not self.overwrites:
            raise self._refused(other)
        return not other and all((self.out / OUTPUTS[name]).is_file() for name in self.settings.outputs)

    def _record_of_complete_run(self) -> Mapping[str, Any] | None:
        path = self.out / RECORD_FILE
        record = read_json(path, "a run's record") if path.is_file() else {}
        return record if record.get("status") == "complete" else None

    def _other_means(self, record: Mapping[str, Any]) -> str:
        return other_means(record, self.settings, self.files, self.version)

    def _refused(self, other: str) -> ConfigError:
        return ConfigError(
            expected=f"{self.out} to be new, or of the same film, settings and detector",
            found=f"a complete run with another {other}",
            fix="choose another folder, or pass --overwrite",
        )

    def check_machine(self) -> None:
        """Refuse a machine with another standoff or other files: its result would not be that of the plan.

        Raises:
            ConfigError: This is one.
        """
        found = None
        if self.version != __version__:
            found = f"standoff {__version__}"
        elif digests(named_files(self.settings)) != self.files:
            found = "other files, or none, at the paths that the settings name"
        if found:
            raise ConfigError(
                expected=f"standoff {self.version} and the same files on every machine",
                found=f"{found} on {socket.gethostname()}",
                fix="install the same version everywhere, and let all machines see the same folders",
            )

    def with_threads(self, cores: int) -> Settings:
        """Return the settings with so many threads for the detector, unless they say how many; 0: all there are."""
        detect = self.settings.detect
        threads = detect.intra_op_threads or cores
        return self.settings.model_copy(update={"detect": replace(detect, intra_op_threads=threads)})
