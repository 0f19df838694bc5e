"""A training run from data to model."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from time import monotonic
from typing import Any, Final

from standoff.core.errors import ConfigError, ModelError
from standoff.evaluation.detection import DetectionScore
from standoff.files.fingerprint import file_sha256
from standoff.files.in_use import FolderInUse
from standoff.labels import LabelledData, Problem
from standoff.labels.summary import summarise
from standoff.training.darknet.cfg import parse_cfg, read_cfg
from standoff.training.darknet.network import DarknetNetwork
from standoff.training.darknet.shapes import check_input
from standoff.training.run.before_after import BeforeAfter, before_after_lines, compare_before_after
from standoff.training.run.card import card_text
from standoff.training.run.data_checks import open_data, report_near_duplicates
from standoff.training.run.distributed import Crew
from standoff.training.run.loop import Progress, Trainer, Watcher
from standoff.training.run.memory import keep_freed_memory
from standoff.training.run.plan import RunPlan, flat_settings
from standoff.training.run.training_folder import TrainingFolder, read_run, refuse_used
from standoff.training.start.starting_point import backbone_of, compose_cfg, fill_network
from standoff.training.start.transfer import Transferred

_MAY_CHANGE: Final = frozenset(
    {"accumulate", "batch", "checkpoint_every", "learning_rate", "patience", "steps", "validate_every", "workers"}
)
"""Settings that a run may go on with otherwise; the rest is in the state of its checkpoint, or would cut its curve."""


@dataclass(frozen=True, slots=True)
class Listener:
    """Who hears of a run.

    Attributes:
        on_message: What people should know, line by line.
        on_step: After each step: its number, its loss, and steps a second since the start.
        on_row: After each validation, its row of the history.
    """

    on_message: Callable[[str], None]
    on_step: Callable[[int, float, float], None]
    on_row: Callable[[dict[str, Any]], None]


def train_detector(plan: RunPlan, out: Path, listener: Listener, *, resumes: bool = False) -> Progress:
    """Train a detector.

    Args:
        plan: What to do. A run that is resumed must have been started with the same but for its length, its batch, and
            how often it is validated and saved.
        out: Folder of the run.
        listener: Hears of it.
        resumes: Go on with the run in the folder.

    Returns:
        See `train_on`.

    Raises:
        DataError, ConfigError, ModelError, OutputError: See the parts.
    """
    leads = Crew.join().leads
    if leads and not resumes:
        refuse_used(out)
    data = open_data(plan.data, [plan.params], listener.on_message if leads else None)
    if leads and not resumes:
        report_near_duplicates(data, listener.on_message)
    return train_on(data, plan, out, listener, resumes=resumes)


def train_on(data: LabelledData, plan: RunPlan, out: Path, listener: Listener, *, resumes: bool = False) -> Progress:
    """Train a detector as `train_detector`, on data that was opened before.

    Args:
        data: That of the plan, as `open_data` gives it.
        plan: See `train_detector`.
        out: Folder of the run: absent or empty, unless the run is resumed.
        listener: Hears of it.
        resumes: Go on with the run in the folder.

    Returns:
        How it went; the best weights and their ONNX file are in the folder.

    Raises:
        DataError, ConfigError, ModelError, OutputError: See the parts.
    """
    keep_freed_memory()
    leads = Crew.join().leads
    folder = TrainingFolder(out, data.classes)
    start = _resumed(folder, plan) if resumes else _started(plan, data, folder, listener, leads=leads)
    backbone_layers = plan.params.backbone_layers or start.backbone_layers
    mark = FolderInUse(out) if leads else None
    trainer = Trainer(start.network, data, plan.params, folder.checkpoints, backbone_layers, folded=start.folded)
    if resumes:
        for name in trainer.resume():
            listener.on_message(f"{name} is damaged and was passed over: going on from step {trainer.progress.step}")
        if leads:
            folder.replace_plan(plan.to_dict(), trainer.progress.step)
    unreadable = _Unreadable(listener)

    def on_validation(progress: Progress, score: DetectionScore, shown: DarknetNetwork) -> None:
        folder.write_validation(progress, score, shown, data.splits["val"])
        listener.on_row(progress.rows[-1])

    first, started_s = trainer.progress.step, monotonic()

    def on_step(step: int, loss: float) -> None:
        listener.on_step(step, loss, (step - first) / (monotonic() - started_s))

    progress = trainer.run(Watcher(on_step, on_validation, unreadable.hear))
    unreadable.sum_up()
    if leads:
        _write_results(plan, data, folder, progress, listener)
    if mark is not None:
        mark.release()
    return progress


def compose_start(plan: RunPlan, data: LabelledData) -> tuple[str, DarknetNetwork, Transferred]:
    """Return what a run starts from: the text of its cfg, the filled network, and where its layers came from.

    Raises:
        ConfigError, DataError, ModelError: Architecture, size of the input or weights do not fit.
    """
    cfg_text = compose_cfg(plan.arch, data, plan.params, plan.weights)
    cfg = parse_cfg(cfg_text, "network.cfg")
    check_input(cfg)
    if plan.params.export_size_px is not None:
        width_px, height_px = plan.params.export_size_px
        check_input(replace(cfg, width_px=width_px, height_px=height_px))
    network, transferred = fill_network(cfg, data.classes, plan.weights, plan.params.seed)
    return cfg_text, network, transferred


@dataclass(frozen=True, slots=True, eq=False)
class _Start:
    """What a run begins or goes on with.

    Attributes:
        network: Filled, unless its checkpoint does it.
        backbone_layers: That the weights filled without a gap.
        folded: Its batch normalisations came without statistics.
    """

    network: DarknetNetwork
    backbone_layers: int
    folded: bool


class _Unreadable:
    """Names each picture that cannot be decoded once, and counts them."""

    def __init__(self, listener: Listener) -> None:
        self._listener = listener
        self._paths: set[Path] = set()

    def hear(self, problem: Problem) -> None:
        if problem.path not in self._paths:
            self._paths.add(problem.path)
            self._listener.on_message(f"skipped {problem}")

    def sum_up(self) -> None:
        if self._paths:
            self._listener.on_message(f"{len(self._paths)} pictures were skipped; others were shown in their place")


def _write_results(
    plan: RunPlan, data: LabelledData, folder: TrainingFolder, progress: Progress, listener: Listener
) -> None:
    folder.write_model(plan.params.export_size_px)
    compared = _compare(plan, data, folder)
    if compared:
        folder.write_comparison(compared)
    folder.write_card(card_text(plan.to_dict(), data, progress, compared))
    for line in before_after_lines(compared):
        listener.on_message(line)
    try:
        folder.write_half_model()
    except ModelError as refusal:
        # The run has been paid for, and its model is there in single precision.
        listener.on_message(f"no model-half.onnx: {refusal}")


def _compare(plan: RunPlan, data: LabelledData, folder: TrainingFolder) -> list[BeforeAfter]:
    """Compare with where the run began, unless that was nothing."""
    if plan.weights is None:
        return []
    params, cfg = plan.params, read_cfg(folder.cfg)
    width_px, height_px = params.export_size_px or params.size_px
    return compare_before_after(
        replace(cfg, width_px=width_px, height_px=height_px),
        (folder.start_weights, folder.best_weights),
        data,
        most=params.validate_pictures,
        bf16=params.bf16,
        device=Crew.join().device,
    )


def _started(plan: RunPlan, data: LabelledData, folder: TrainingFolder, listener: Listener, *, leads: bool) -> _Start:
    cfg_text, network, transferred = compose_start(plan, data)
    facts = {
        "data": asdict(summarise(data)),
        "weights_sha256": None if plan.weights is None else file_sha256(plan.weights),
        "transferred": asdict(transferred),
        "backbone_layers": backbone_of(network, transferred),
        "problems": [str(problem) for problem in data.problems],
    }
    if leads:
        layers = len(transferred.copied), len(transferred.resized), len(transferred.fresh)
        listener.on_message(
            f"{plan.arch}: {layers[0]} convolutions from {transferred.source}, {layers[1]} fitted, {layers[2]} fresh"
        )
        folder.write_start(cfg_text, network, plan.to_dict(), facts)
    return _Start(network, backbone_of(network, transferred), transferred.folded)


def _resumed(folder: TrainingFolder, plan: RunPlan) -> _Start:
    cfg = read_cfg(folder.cfg)
    facts = folder.read_start()
    classes = folder.read_classes()
    if classes != folder.classes:
        raise ConfigError(
            expected=f"the classes that {folder.path} was started with, {', '.join(classes)}",
            found=f"{', '.join(folder.classes)} in the data",
            fix="give the same data, or start a new run",
        )
    before, now = (flat_settings(one["train"]) for one in (read_run(folder.path), plan.to_dict()))
    for name in sorted(now.keys() & before.keys() - _MAY_CHANGE):
        if now[name] != before[name]:
            raise ConfigError(
                expected=f"{name} {before[name]}, with which {folder.path} was started",
                found=f"{now[name]}",
                fix=f"leave it as it was (only {', '.join(sorted(_MAY_CHANGE))} may change), or start a new run",
            )
    return _Start(DarknetNetwork(cfg), int(facts["backbone_layers"]), bool(facts["transferred"].get("folded")))


__all__ = ["Listener", "RunPlan", "compose_start", "read_run", "train_detector", "train_on"]
