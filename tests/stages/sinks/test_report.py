from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from pages import PageReader, without_pictures
from stages.sinks.fake_site import COMPLETE, FakeSite, ended, quiet

from standoff.core.durations import minutes_text
from standoff.core.lengths import METRES
from standoff.core.types import FrameResult, Hazard, NoGroundMap, Outcome
from standoff.stages.sinks import ReportParams, ReportSink
from standoff.stages.sinks.collect import RunSummary

SITE = (320, 180)
NAN = float("nan")


@pytest.fixture(scope="module")
def results() -> list[FrameResult]:
    return list(FakeSite(SITE).results(150))


_PLAIN = ReportParams(pairs=1, moments=0)
"""For what is said in words: charts take a second a page."""


def _page(folder: Path, results: list[FrameResult], outcome: Outcome = COMPLETE, **arguments: Any) -> str:
    sink = ReportSink(folder / "report.html", **arguments)
    for result in results:
        sink.write(result)
    assert list(folder.iterdir()) == []  # nothing half-written while the run goes on
    sink.close(ended(results, outcome))
    assert [path.name for path in folder.iterdir()] == ["report.html"]
    return (folder / "report.html").read_text(encoding="utf-8")


def test_the_page_needs_nothing_from_outside(tmp_path: Path, results: list[FrameResult]) -> None:
    page = _page(tmp_path, results)
    reader = PageReader.of(page)
    assert {"svg", "img", "table", "style"} <= set(reader.tags)
    assert not {"script", "link", "iframe"} & set(reader.tags)
    assert reader.fetched
    assert all(target.startswith(("data:image/", "#")) for target in reader.fetched)
    assert all(target.startswith("#") for target in re.findall(r"url\(([^)]*)\)", page))
    assert "@import" not in page
    assert set(re.findall(r"https?://[^\"'\s<]*", page)) <= {"http://www.w3.org/2000/svg"}


def test_reasons_and_descriptions_are_escaped(tmp_path: Path, results: list[FrameResult]) -> None:
    hostile = "<script>alert(1)</script>"
    page = _page(
        tmp_path,
        results,
        Outcome("failed", hostile, sink_errors={hostile: hostile}, about={"source": {"path": hostile}}),
    )
    assert "<script" not in page
    assert "reference hidden &amp; &lt;not&gt; found" in page
    assert PageReader.of(page).text.count(hostile) >= 4


def test_no_number_reads_nan(tmp_path: Path, results: list[FrameResult]) -> None:
    never_measured = Hazard("U", "proximity", "unknown", "opened", (1, 2), 0.0, NAN, NAN, NAN, "outside")
    results = [replace(results[0], hazards=(*results[0].hazards, never_measured)), *results[1:]]
    page = _page(tmp_path, results)
    assert not re.search(r"\b(nan|NaN|inf|None)\b", without_pictures(page))
    assert "unknown worker 1 and worker 2 0:00.0 open 0:06.0 unknown unknown outside" in PageReader.of(page).text


def test_errors_that_nobody_checked_are_said_to_be_unchecked(tmp_path: Path, results: list[FrameResult]) -> None:
    for name, checked in (("never", None), ("broken off", lambda: "")):
        (folder := tmp_path / name).mkdir()
        text = PageReader.of(_page(folder, results[:5], params=_PLAIN, checked=checked)).text
        assert text.count("not checked on your site") == 1
        assert "checked against the truth" not in text


def test_errors_that_were_checked_against_truth_are_shown(tmp_path: Path, results: list[FrameResult]) -> None:
    section = '<section id="checked"><h2>How true the stated errors are</h2></section>'
    page = _page(tmp_path, results[:5], params=_PLAIN, checked=lambda: section)
    assert page.count(section) == 1 and page.count('href="#checked"') == 1
    assert "not checked" not in PageReader.of(page).text


def test_an_interrupted_run_says_so_at_the_top(tmp_path: Path, results: list[FrameResult]) -> None:
    text = PageReader.of(
        _page(tmp_path, results[:40], Outcome("interrupted", "stopped by the operator"), params=_PLAIN)
    ).text
    assert "This run was interrupted: stopped by the operator. The report covers 0:00.0 to 0:01.6 only." in text
    assert text.index("interrupted") < text.index("Proximity over time")


def test_a_run_without_a_frame_knows_nothing(tmp_path: Path) -> None:
    text = PageReader.of(_page(tmp_path, [], Outcome("failed", "model missing"))).text
    assert "This run failed: model missing. No frame was processed." in text
    assert "nothing is known about hazards" in text
    assert "None." not in text


def test_a_run_without_any_map_never_reads_as_safe(tmp_path: Path, results: list[FrameResult]) -> None:
    text = PageReader.of(_page(tmp_path, [quiet(results[70]) for _ in range(5)], params=_PLAIN)).text
    assert "Nothing was measured: no frame has a ground map. This report says nothing about safety." in text
    assert "Unknown: nothing was measured." in text
    assert "0 % of frames with a ground map" in text
    assert "None." not in text


def test_measured_frames_without_hazard_and_lost_frames_are_told_apart(
    tmp_path: Path, results: list[FrameResult]
) -> None:
    calm = [quiet(result) for result in results]
    (tmp_path / "all").mkdir()
    (tmp_path / "some").mkdir()
    assert "Hazards None." in PageReader.of(_page(tmp_path / "all", calm[:25], params=_PLAIN)).text
    text = PageReader.of(_page(tmp_path / "some", calm, params=_PLAIN)).text
    assert "None in the frames that were measured; unknown in the others." in text
    assert "13.3 % of the frames have no ground map" in text


def test_a_share_just_below_all_is_not_called_all(tmp_path: Path, results: list[FrameResult]) -> None:
    few = [replace(quiet(results[0]), frame=replace(results[0].frame, index=i, time_s=i / 25)) for i in range(2000)]
    few[7] = replace(few[7], ground=NoGroundMap("hidden"))
    text = PageReader.of(_page(tmp_path, few, params=_PLAIN)).text
    assert "99.9 % of frames with a ground map" in text
    assert "100 % of frames" not in text


def test_hazards_are_listed_with_their_smallest_distance(tmp_path: Path, results: list[FrameResult]) -> None:
    text = PageReader.of(_page(tmp_path, results, params=_PLAIN)).text
    of_pair = [r.proximities[(r.proximities.track_a == 2) & (r.proximities.track_b == 3)] for r in results]
    smallest = np.nanmin([pair.distance_m[0] for pair in of_pair])
    assert f"danger worker 2 and excavator 3 0:00.0 0:02.0 0:02.0 {smallest:.1f} ±0.3 m" in text


def test_what_the_end_of_the_stream_closes_is_closed(tmp_path: Path, results: list[FrameResult]) -> None:
    first = results[0].hazards[0]
    closing = replace(first, phase="closed", time_s=1.0, reason="end of stream")
    (tmp_path / "open").mkdir()
    (tmp_path / "closed").mkdir()
    assert "open" in PageReader.of(_page(tmp_path / "open", results[:20], params=_PLAIN)).texts
    text = PageReader.of(
        _page(tmp_path / "closed", results[:20], Outcome("complete", hazards=(closing,)), params=_PLAIN)
    ).text
    assert "end of stream" in text


@pytest.mark.live
def test_many_pairs_and_frames_make_a_page_of_a_few_megabytes(tmp_path: Path) -> None:
    site = FakeSite(SITE, tracks=16)
    some = [site.result(index) for index in range(50)]
    results = [
        replace(result, frame=replace(result.frame, index=i, time_s=i / 25))
        for i, result in ((i, some[i % 50]) for i in range(600))
    ]
    page = _page(tmp_path, results)
    assert len(page) < 6_000_000


def test_memory_is_bounded_whatever_the_number_of_pairs(results: list[FrameResult]) -> None:
    summary = RunSummary(ReportParams(pairs=5, moments=2))
    for result in FakeSite(SITE, tracks=30).results(40):
        summary.add(result)
    assert len(summary.pairs) == 5
    assert len(summary.moments.worth_showing(100.0)) == 2


def test_the_closest_pairs_are_the_ones_that_are_kept() -> None:
    summary, site = RunSummary(ReportParams(pairs=5, moments=3)), FakeSite(SITE, tracks=30)
    smallest: dict[tuple[int, int], float] = {}
    for result in site.results(40):
        summary.add(result)
        pairs = result.proximities
        for a, b, gap in zip(pairs.track_a.tolist(), pairs.track_b.tolist(), pairs.gap_m.tolist(), strict=True):
            if gap < smallest.get((a, b), np.inf):
                smallest[a, b] = gap
    expected = sorted(smallest, key=smallest.__getitem__)
    assert summary.worst_pairs() == expected[:5]
    for moment, pair in zip(summary.moments.worth_showing(100.0), expected, strict=False):
        assert moment.gap_m - smallest[pair] < 0.1 + 1e-9


def test_a_worst_moment_shows_its_pair(results: list[FrameResult]) -> None:
    summary = RunSummary(ReportParams(moments=2, moment_width_px=320))
    for result in results[:30]:
        summary.add(result)
    for moment in summary.moments.worth_showing(100.0):
        picture = cv2.imdecode(np.frombuffer(moment.jpeg(METRES), np.uint8), cv2.IMREAD_COLOR)
        assert picture is not None
        assert picture.shape[1] >= 800
        left, top, right, bottom = moment.region_px
        assert (right - left) / (bottom - top) == pytest.approx(16 / 9, rel=0.05)
        feet = moment.measurements.feet_px()[[int(name.split()[-1]) - 1 for name in moment.names]]
        assert ((feet > [left, top]) & (feet < [right, bottom])).all()


@pytest.mark.parametrize(
    ("time_s", "text"), [(0.0, "0:00.0"), (59.96, "1:00.0"), (3600.0, "60:00.0"), (NAN, "unknown")]
)
def test_a_clock_time_rounds_over_the_minute(time_s: float, text: str) -> None:
    assert minutes_text(time_s) == text
