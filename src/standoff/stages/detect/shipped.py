"""The detectors that come with standoff, by name."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path
from typing import Final, Literal, get_args

from standoff.core.errors import ModelError

ShippedModel = Literal["site"]
SHIPPED_MODELS: Final[tuple[ShippedModel, ...]] = get_args(ShippedModel)


_GROUND_POINTS: Final = ("ground-points.onnx", "ground-points-machines.onnx")
"""Of workers and excavators, and of the other machines."""


def find_ground_points(name: str) -> tuple[Path, ...]:
    """Return the files of the networks of ground points.

    Args:
        name: "site", "none", or the path of an ONNX file.

    Returns:
        Of different classes each; nothing for "none".

    Raises:
        ModelError: standoff was installed without one.
    """
    if name == "none":
        return ()
    if name != "site":
        return (Path(name),)
    return tuple(_file_of_ours(file, "a network of ground points") for file in _GROUND_POINTS)


def find_model(model: str | Path) -> Path:
    """Return the file of a detector.

    Args:
        model: One of `SHIPPED_MODELS`, or the path of an ONNX file.

    Raises:
        ModelError: standoff was installed without the detector of this name.

    >>> find_model("yolo.onnx").name
    'yolo.onnx'
    """
    if model not in SHIPPED_MODELS:
        return Path(model)
    return _file_of_ours(f"{model}.onnx", f"the detector '{model}'")


def _file_of_ours(name: str, what: str) -> Path:
    path = Path(str(files("standoff"))) / "models" / name
    if not path.is_file():
        raise ModelError(
            expected=f"{what} that comes with standoff",
            found=f"no {path}",
            fix="install standoff again, or give an ONNX file of your own",
        )
    return path
