"""The settings of the preset."""

from __future__ import annotations

from importlib.resources import files
from typing import Any

from standoff.files.yaml_text import parse_yaml


def read_preset() -> dict[str, Any]:
    """Return arch, weights and train settings, as a plan file has them; the data are the user's."""
    text = (files("standoff.training.my_site") / "preset.yaml").read_text(encoding="utf-8")
    preset: dict[str, Any] = parse_yaml(text, "the preset", "preset.yaml")
    return preset
