"""Read the settings of a part that is no stage: a frozen dataclass of plain values."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, TypeVar, cast

from pydantic import ConfigDict, ValidationError, create_model

from standoff.config.load import config_error

T = TypeVar("T")


def read_params(kind: type[T], values: Mapping[str, Any], origin: str, advice: str) -> T:
    """Build settings from nested plain values, checked against their bounds.

    Args:
        kind: Frozen dataclass of plain values and of others like it.
        values: By name; absent ones keep their defaults.
        origin: Where they come from, for messages.
        advice: What to do about a mistake, for messages.

    Raises:
        ConfigError: A name that does not exist, or a value out of bounds.
    """
    # A dataclass takes the configuration of the model around it: here, to refuse unknown names.
    model = create_model("Params", __config__=ConfigDict(extra="forbid"), settings=(kind, ...))
    try:
        return cast(T, model(settings=dict(values)).settings)  # type: ignore[attr-defined]
    except ValidationError as error:
        raise config_error(origin, error, advice) from error
