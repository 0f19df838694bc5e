"""People read metres or feet; what is shown is the same."""

from __future__ import annotations

import html
import re
from pathlib import Path

import cv2
import numpy as np
import pytest
from pages import PageReader
from stages.sinks.fake_site import FakeSite, ended, quiet

from standoff.core.lengths import FEET, METRES, LengthUnit
from standoff.core.types import FrameResult, ImageArray, Outcome
from standoff.drawing.painter import Painter
from standoff.drawing.text import TextSprites
from standoff.stages.sinks import Composer, DrawParams, ReportParams, ReportSink, ShowParams, VideoParams
from standoff.stages.sinks.birdseye import BirdsEye
from standoff.stages.sinks.frame_measurements import FrameMeasurements
from standoff.stages.sinks.sketch import Sketch

FOOT_M = 0.3048
PANEL = (420, 400)


@pytest.fixture(scope="module")
def results() -> list[FrameResult]:
    return list(FakeSite((320, 180)).results(75))


def _page(folder: Path, results: list[FrameResult], show: ShowParams) -> str:
    about = {"ground": {"basis": "a square reference of 2.89 m: expect 1 %"}}
    path = folder / f"{show.unit}.html"
    sink = ReportSink(path, ReportParams(pairs=4, moments=1), show=show)
    for result in results:
        sink.write(result)
    sink.close(ended(results, Outcome("complete", about=about)))
    return path.read_text(encoding="utf-8")


def test_lines_of_the_film_say_the_same_distances(results: list[FrameResult]) -> None:
    measurements = FrameMeasurements.of(quiet(results[0]))
    in_metres, in_feet = (Sketch.of(measurements, DrawParams(), unit).lines for unit in (METRES, FEET))
    assert len(in_metres) > 2
    for one, other in zip(in_metres, in_feet, strict=True):
        assert one.text.endswith(" m") and other.text.endswith(" ft")
        assert float(other.text.split()[0]) * FOOT_M == pytest.approx(
            float(one.text.split()[0]), abs=0.05 + 0.5 * FOOT_M
        )


@pytest.mark.parametrize("unit", [METRES, FEET])
def test_the_panels_scale_bar_is_as_long_as_it_says(
    monkeypatch: pytest.MonkeyPatch, results: list[FrameResult], unit: LengthUnit
) -> None:
    panel, text = np.zeros((PANEL[1], PANEL[0], 3), dtype=np.uint8), TextSprites()
    said: list[str] = []
    original = text.sprite

    def sprite(word: str, size_px: int, *, bold: bool = False) -> ImageArray:
        said.append(word)
        return original(word, size_px, bold=bold)

    monkeypatch.setattr(text, "sprite", sprite)
    birdseye = BirdsEye(PANEL, DrawParams(circles=False, labels=False, fans=False), text)
    sketch = Sketch.of(FrameMeasurements.of(quiet(results[0])), DrawParams(), unit)
    birdseye.draw(panel, results[0].frame.image, sketch)
    (label,) = {word for word in said if word.endswith(f" {unit.symbol}")}
    window = birdseye._window
    assert window is not None
    bottom = PANEL[1] - Painter(panel, text).font_px
    # All else is dimmed: only the bar is as light as this.
    length_px = int((panel[bottom - 2 : bottom + 3].min(axis=2) > 190).any(axis=0).sum())
    assert length_px * window.m_per_px == pytest.approx(float(label.split()[0]) * unit.in_m, abs=3 * window.m_per_px)


def test_a_report_in_feet_has_no_metres_but_those_that_it_translates(
    tmp_path: Path, results: list[FrameResult]
) -> None:
    pages = {unit: _page(tmp_path, results, ShowParams(unit=unit)) for unit in ("metres", "feet")}
    said = {name: PageReader.of(page).text.partition("How it was made")[0] for name, page in pages.items()}
    assert re.findall(r"[\d.]+ m\b", said["feet"]) == ["2.89 m"]
    assert "rest on a square reference of 2.89 m (9.5 ft)" in said["feet"]
    assert not re.findall(r"\bft\b|feet", said["metres"])
    assert "Site frame in feet." in said["feet"] and "gap below 3.28 ft" in said["feet"]
    assert ">gap of the closest pair, ft<" in pages["feet"] and ">x, ft<" in pages["feet"]
    distances = {name: _distances(text) for name, text in said.items()}
    assert len(distances["metres"]) == len(distances["feet"]) > 5
    in_feet = np.array(distances["feet"]) * FOOT_M
    np.testing.assert_allclose(in_feet, distances["metres"], atol=0.05 + 0.05 * FOOT_M)


def _distances(text: str) -> list[float]:
    return [float(number) for number in re.findall(r"(-?[\d.]+) ±", html.unescape(text))]


def test_the_film_differs_in_its_words_only(results: list[FrameResult]) -> None:
    plain = VideoParams(panel=False, draw=DrawParams(labels=False))
    measurements = FrameMeasurements.of(quiet(results[0]))
    image = results[0].frame.image
    first, other = (
        Composer((320, 180), plain, ShowParams(unit=name)).compose(cv2.resize(image, (320, 180)), measurements).copy()
        for name in ("metres", "feet")
    )
    np.testing.assert_array_equal(first, other)
