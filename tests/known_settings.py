"""Settings of monitors that are checked once: each check takes as long as many a whole test."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import pytest

from standoff.config import Settings, settings_from

_KNOWN: dict[str, Settings] = {}


def know_settings(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let `load_site` take what was checked before, in any test, for the same settings at the same place."""
    monkeypatch.setattr("standoff.config.site.settings_from", _known)


def _known(from_file: Mapping[str, Any], origin: str) -> Settings:
    # The same settings of other tests stand in other folders, which are no part of what is right and wrong in them.
    key = json.dumps(dict(from_file), default=repr)
    if key not in _KNOWN:
        _KNOWN[key] = settings_from(from_file, origin)
    return _KNOWN[key]
