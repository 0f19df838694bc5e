from __future__ import annotations

import pytest

from standoff.core.errors import MissingDependency
from standoff.drawing.encoder import available_encoder


def test_without_any_encoder_the_reader_is_told_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("standoff.drawing.encoder._ENCODERS", ("no_such_encoder",))
    with pytest.raises(MissingDependency, match=r"no_such_encoder.*pip install"):
        available_encoder()
