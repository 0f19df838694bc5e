from __future__ import annotations

from pathlib import Path

import pytest

from standoff.config import SiteSettings, load_site
from standoff.core.errors import ConfigError

SITE = """
defaults:
  ground: {reference: {square_m: 2.89}, camera: lens.yaml}
  hazard: {buffer_m: 2.0, release_s: 1.0}
streams:
  gate:
    address: rtsp://10.0.0.5/live
  crane-2:
    address: replay://film.mp4
    ground: {camera: other.yaml}
    hazard: {release_s: 0.2}
    detect_every: 3
"""


def site(folder: Path, text: str) -> SiteSettings:
    path = folder / "site.yaml"
    path.write_text(text, encoding="utf-8")
    return load_site(path)


def test_each_stream_has_the_defaults_but_for_what_it_says_itself(tmp_path: Path) -> None:
    loaded = site(tmp_path, SITE)
    gate, crane = loaded.streams["gate"], loaded.streams["crane-2"]
    assert (gate.address, crane.address) == ("rtsp://10.0.0.5/live", f"replay://{tmp_path / 'film.mp4'}")
    assert gate.settings.model_dump() == loaded.defaults.model_dump()
    assert (crane.settings.hazard.buffer_m, crane.settings.hazard.release_s) == (2.0, 0.2)
    assert (gate.settings.detect_every, crane.settings.detect_every) == (1, 3)
    assert gate.settings.ground.camera == tmp_path / "lens.yaml"
    assert crane.settings.ground.camera == tmp_path / "other.yaml"
    assert crane.settings.ground.reference == gate.settings.ground.reference


def test_what_one_stream_changes_is_not_changed_for_another(tmp_path: Path) -> None:
    swapped = SITE.replace("gate:", "x:").replace("crane-2:", "a:")
    assert site(tmp_path, swapped).streams["x"].settings.hazard.release_s == 1.0


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("model: site\n", "model at the top level"),
        ("defaults: {}\n", "no stream by name"),
        ("streams: {}\n", "no stream by name"),
        ("streams: [a, b]\n", "no stream by name"),
        ("streams: {gate: {}}\n", "an `address` in .*streams.gate"),
        ("streams: {gate: rtsp://x}\n", "an `address` in .*streams.gate"),
        ("streams: {'a/b': {address: x}}\n", "letters, digits"),
        ("streams: {gate: {address: x, hazzard: {}}}\n", "streams.gate, found .*did you mean hazard"),
        ("defaults: {detect_every: 0}\nstreams: {gate: {address: x}}\n", "site.yaml: defaults"),
        ("streams: {gate: {address: x, detect_every: 0}}\n", "streams.gate, found detect_every"),
    ],
)
def test_what_is_wrong_is_one_line_that_says_of_which_stream(tmp_path: Path, text: str, told: str) -> None:
    with pytest.raises(ConfigError, match=told) as raised:
        site(tmp_path, text)
    assert "\n" not in str(raised.value)
