"""The folder of a training run: everything that it takes to judge it, to use it, to go on with it or to repeat it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from standoff import __version__
from standoff.config import read_settings_file
from standoff.core.errors import ConfigError, OutputError
from standoff.evaluation.detection import DetectionScore
from standoff.files.json_text import plain, write_json
from standoff.files.whole import whole_file
from standoff.files.yaml_text import write_yaml
from standoff.labels import LabelledPicture
from standoff.labels.documents import read_json
from standoff.labels.splits import spread
from standoff.training.darknet.cfg import read_cfg
from standoff.training.darknet.export import export_darknet, read_names
from standoff.training.darknet.network import DarknetNetwork
from standoff.training.darknet.weights import WeightsHeader, save_weights
from standoff.training.quantization.half_precision import store_half
from standoff.training.run.before_after import BeforeAfter
from standoff.training.run.figures import draw_curves, draw_predictions
from standoff.training.run.loop import Progress
from standoff.training.run.tables import markdown_table
from standoff.training.run.validation import detect_pictures

CHECKPOINTS: Final = "checkpoints"
PREPARED_DATA: Final = "data"
"""Folder in a run's folder in which a preset writes what it makes of its user's data."""

_SHOWN_PICTURES: Final = 6


@dataclass(frozen=True, slots=True)
class TrainingFolder:
    """Paths and writers of one run.

    Attributes:
        path: The folder.
        classes: Names.
    """

    path: Path
    classes: tuple[str, ...]

    @property
    def checkpoints(self) -> Path:
        """Folder of checkpoints."""
        return self.path / CHECKPOINTS

    @property
    def cfg(self) -> Path:
        """The network."""
        return self.path / "network.cfg"

    @property
    def best_weights(self) -> Path:
        """Averaged weights of the best validation so far."""
        return self.path / "best.weights"

    @property
    def start_weights(self) -> Path:
        """Weights before the first step."""
        return self.path / "start.weights"

    @property
    def last_weights(self) -> Path:
        """Averaged weights of the last validation."""
        return self.path / "last.weights"

    def write_start(
        self, cfg_text: str, network: DarknetNetwork, configuration: dict[str, Any], facts: dict[str, Any]
    ) -> None:
        """Write what the run is before it begins.

        Args:
            cfg_text: Of the network.
            network: Where the run starts: written as `start.weights`, for `standoff blend`.
            configuration: What repeats the run: written as `run.yaml`.
            facts: About the data and the starting point, for people and records.

        Raises:
            OutputError: The folder cannot be written.
        """
        try:
            self.path.mkdir(parents=True, exist_ok=True)
            self._write_text("network.cfg", cfg_text)
            self._write_text("classes.names", "\n".join(self.classes) + "\n")
            write_json(self.path / "start.json", {"standoff": __version__, **facts})
            save_weights(network, self.start_weights)
            # The last: where it is, the others are.
            self.write_plan(configuration)
        except OSError as error:
            raise OutputError(
                expected=f"to write to {self.path}", found=str(error.strerror), fix="choose a folder that is writable"
            ) from error

    def write_plan(self, configuration: dict[str, Any]) -> None:
        """Write `run.yaml`, which repeats the run.

        Raises:
            OutputError: It cannot be written.
        """
        write_yaml(self.path / "run.yaml", plain(configuration))

    def replace_plan(self, configuration: dict[str, Any], step: int) -> None:
        """Record what a run goes on with; what held until this step, if different, stays as `run-until-STEP.yaml`.

        Raises:
            OutputError: It cannot be written.
        """
        before = read_run(self.path)
        if before != plain(configuration):
            write_yaml(self.path / f"run-until-{step}.yaml", before)
            self.write_plan(configuration)

    def read_start(self) -> dict[str, Any]:
        """Read the facts again.

        Raises:
            DataError: They are not there.
        """
        return read_json(self.path / "start.json")

    def read_classes(self) -> tuple[str, ...]:
        """Read the names that the run was started with.

        Raises:
            ModelError: They are not there, or do not belong to the network.
        """
        return read_names(self.path / "classes.names", read_cfg(self.cfg))

    def write_validation(
        self,
        progress: Progress,
        score: DetectionScore,
        network: DarknetNetwork,
        pictures: Sequence[LabelledPicture],
    ) -> None:
        """Write weights, table and curves after a validation; for the best one also predictions and scores.

        Args:
            progress: Its last row is this validation.
            score: Its figures.
            network: The averaged network.
            pictures: Of the validation split; some are shown.
        """
        header = WeightsHeader(seen=progress.seen)
        save_weights(network, self.last_weights, header)
        write_json(self.path / "history.json", progress.rows)
        self._write_text("table.md", markdown_table(progress.rows, self.classes))
        self._write("curves.png", lambda path: draw_curves(progress.rows, self.classes, path))
        if progress.best_step == progress.step:
            save_weights(network, self.best_weights, header)
            write_json(self.path / "best.json", {"step": progress.step, **score.to_dict()})
            readable, found = detect_pictures(network, spread(pictures, _SHOWN_PICTURES), bf16=False)
            if readable:
                self._write("predictions.jpg", lambda path: draw_predictions(readable, found, self.classes, path))

    def write_model(self, size_px: tuple[int, int] | None) -> None:
        """Export the best weights as ONNX, for an input of another size (width, height) than the cfg's, if given."""
        export_darknet(self.cfg, self.best_weights, self.path / "classes.names", size_px, self.path / "model.onnx")

    def write_half_model(self) -> None:
        """Store the exported model's weights in half precision.

        Raises:
            ModelError: That would move boxes too far.
        """
        store_half(self.path / "model.onnx", self.path / "model-half.onnx")

    def write_comparison(self, compared: Sequence[BeforeAfter]) -> None:
        """Write what the run gained and lost, set by set."""
        write_json(self.path / "before-after.json", [one.to_dict() for one in compared])

    def write_card(self, text: str) -> None:
        """Write the model card."""
        self._write_text("model-card.md", text)

    def _write_text(self, name: str, text: str) -> None:
        self._write(name, lambda path: path.write_text(text, encoding="utf-8"))

    def _write(self, name: str, write: Callable[[Path], object]) -> None:
        with whole_file(self.path / name) as path:
            write(path)


def read_run(folder: Path) -> dict[str, Any]:
    """Read what a run was started, or last resumed, with.

    Raises:
        ConfigError: There is no run in the folder, or its record is damaged.
    """
    path = folder / "run.yaml"
    if not path.is_file():
        raise ConfigError(
            expected=f"a training run to go on with in {folder}",
            found="no run.yaml",
            fix="start one without --resume, in a new or empty folder",
        )
    return read_settings_file(path)


def refuse_used(folder: Path) -> None:
    """Refuse a folder that holds something, unless that is the data of a preset.

    Raises:
        OutputError: It does.
    """
    if folder.exists() and (not folder.is_dir() or any(one.name != PREPARED_DATA for one in folder.iterdir())):
        raise OutputError(
            expected="a new or empty output folder",
            found=f"files in {folder}",
            fix="choose another one, or pass --resume to go on with the run in it",
        )
