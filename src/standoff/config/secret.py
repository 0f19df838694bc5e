"""A secret that a settings file names and does not hold."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

from pydantic import BeforeValidator, PlainSerializer, ValidationInfo

FOLDER = "folder"
"""In the context of a validation: what paths in the settings are relative to."""


@dataclass(frozen=True, slots=True)
class Secret:
    """A secret, and where it comes from.

    Attributes:
        origin: `env:NAME` or `file:PATH`, as in the settings.
        value: Never shown.
    """

    origin: str
    value: str = field(repr=False)

    def __str__(self) -> str:
        return self.origin


def read_secret(origin: str, folder: Path, environment: Mapping[str, str] | None = None) -> Secret:
    """Fetch a secret from where the settings say it is.

    Args:
        origin: `env:NAME` or `file:PATH`.
        folder: What a path is relative to.
        environment: Variables; None: those of this process.

    Raises:
        ValueError: It is none of both, or there is nothing; the message never holds the secret.

    >>> read_secret("env:DOOR", Path(), {"DOOR": "sesame"}).value
    'sesame'
    """
    kind, _, where = origin.partition(":")
    if kind == "env" and where:
        value = (os.environ if environment is None else environment).get(where, "")
        if not value:
            raise ValueError(f"the environment variable {where} is not set")
        return Secret(origin, value)
    if kind == "file" and where:
        try:
            value = (folder / where).read_text(encoding="utf-8").strip()
        except (OSError, UnicodeDecodeError) as error:
            raise ValueError(f"{where} cannot be read: {getattr(error, 'strerror', None) or 'no text'}") from None
        if not value:
            raise ValueError(f"{where} is empty")
        return Secret(origin, value)
    raise ValueError("a secret does not stand in the settings: write env:NAME or file:PATH")


def _fetched(given: object, info: ValidationInfo) -> object:
    if given is None or isinstance(given, Secret):
        return given
    if not isinstance(given, str):
        raise ValueError("a secret does not stand in the settings: write env:NAME or file:PATH")
    folder = (info.context or {}).get(FOLDER, Path())
    return read_secret(given, folder)


SecretSetting = Annotated[Secret, BeforeValidator(_fetched), PlainSerializer(str, return_type=str)]
"""A setting that holds a `Secret`."""
