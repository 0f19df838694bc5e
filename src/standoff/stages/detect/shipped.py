"""The detectors that come with standoff, by name."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path
from typing import Final, Literal, get_args

from standoff.core.errors import ModelError

ShippedModel = Literal["site", "site-int8"]
SHIPPED_MODELS: Final[tuple[ShippedModel, ...]] = get_args(ShippedModel)


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
    path = Path(str(files("standoff"))) / "models" / f"{model}.onnx"
    if not path.is_file():
        raise ModelError(
            expected=f"the detector '{model}' that comes with standoff",
            found=f"no {path}",
            fix="install standoff again, or pass --model with an ONNX file (`standoff export` makes one)",
        )
    return path
