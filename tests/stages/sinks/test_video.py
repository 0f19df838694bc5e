from __future__ import annotations

import io
from pathlib import Path

import av
import numpy as np
import pytest
from stages.sinks.fake_site import FakeSite

from standoff.core.types import Outcome
from standoff.stages.sinks import Composer, VideoParams, VideoSink


def _times(path: Path) -> list[float]:
    with av.open(str(path)) as container:
        return [float(frame.time) for frame in container.decode(video=0)]


def _playable(data: bytes) -> int:
    """Count the pictures that a player shows before it comes to the cut."""
    shown = 0
    with av.open(io.BytesIO(data)) as container:
        try:
            for _ in container.decode(video=0):
                shown += 1
        except av.error.InvalidDataError:
            pass  # half a picture at the very end
    return shown


def test_presentation_times_are_kept_with_variable_frame_rate(tmp_path: Path) -> None:
    site, sink = FakeSite((320, 180)), VideoSink(tmp_path / "annotated.mp4")
    times = 60.0 + np.cumsum(np.random.default_rng(1).uniform(0.01, 0.4, 40))
    for index, time_s in enumerate(times.tolist()):
        sink.write(site.result(index, time_s=time_s))
    sink.close(Outcome("complete"))
    np.testing.assert_allclose(_times(tmp_path / "annotated.mp4"), times - times[0], atol=1 / 60_000)
    assert [path.name for path in tmp_path.iterdir()] == ["annotated.mp4"]


def test_a_time_that_stands_still_loses_no_frame(tmp_path: Path) -> None:
    site, sink = FakeSite((320, 180)), VideoSink(tmp_path / "annotated.mp4")
    for index, time_s in enumerate([0.0, 0.04, 0.04, 0.03, 0.08]):
        sink.write(site.result(index, time_s=time_s))
    sink.close(Outcome("complete"))
    times = _times(tmp_path / "annotated.mp4")
    assert len(times) == 5
    assert (np.diff(times) > 0).all()


def test_an_unfinished_video_can_be_played_wherever_it_is_cut(tmp_path: Path) -> None:
    site, sink = FakeSite((320, 180)), VideoSink(tmp_path / "annotated.mp4")
    for result in site.results(150):
        sink.write(result)
    written = (tmp_path / "annotated.mp4").read_bytes()
    first_fragment = written.index(b"moof") - 4
    counts = [_playable(written[:size]) for size in np.linspace(first_fragment, len(written), 23).astype(int).tolist()]
    assert counts == sorted(counts)
    assert counts[0] == 0
    assert counts[-1] >= 95
    sink.close(Outcome("interrupted"))
    assert len(_times(tmp_path / "annotated.mp4")) == 150


def test_a_run_without_frames_leaves_no_video(tmp_path: Path) -> None:
    VideoSink(tmp_path / "annotated.mp4").close(Outcome("failed"))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("size_px", [(1280, 720), (3841, 2161), (641, 481), (1080, 1920)])
@pytest.mark.parametrize("panel", [True, False])
def test_the_composed_picture_is_even_and_within_the_width(size_px: tuple[int, int], panel: bool) -> None:
    composer = Composer(size_px, VideoParams(panel=panel, max_width_px=1600))
    width, height = composer.size_px
    assert width % 2 == 0
    assert height % 2 == 0
    assert width <= 1602
    picture_width, picture_height = composer.picture_size_px
    assert picture_width / picture_height == pytest.approx(size_px[0] / size_px[1], rel=0.01)
    assert (width > picture_width) == panel


def test_an_odd_sized_source_is_written(tmp_path: Path) -> None:
    site, sink = FakeSite((333, 187)), VideoSink(tmp_path / "annotated.mp4", VideoParams(panel=False))
    sink.write(site.result(0))
    sink.close(Outcome("complete"))
    assert len(_times(tmp_path / "annotated.mp4")) == 1


def test_another_encoder_takes_over(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("standoff.drawing.encoder._ENCODERS", ("no_such_encoder", "mpeg4"))
    site, sink = FakeSite((320, 180)), VideoSink(tmp_path / "annotated.mp4")
    for result in site.results(10):
        sink.write(result)
    sink.close(Outcome("complete"))
    np.testing.assert_allclose(_times(tmp_path / "annotated.mp4"), np.arange(10) / 25, atol=1e-3)
