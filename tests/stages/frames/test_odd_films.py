"""Films that lie on their side, mirrored, with oblong pixels, beside a preview, or with times that do not rise."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest
from stages.frames.coded_video import Recipe, coded_picture, index_in, write_video
from tolerances import RESIZED_LEVELS

from standoff.core.errors import SourceError
from standoff.stages.frames import open_source
from standoff.stages.frames.times import RisingTimes


@pytest.mark.parametrize(
    ("display", "as_ffmpeg"),
    [
        ((-1, 0, 0, 1), "hflip"),
        ((1, 0, 0, -1), "vflip"),
        ((-1, 0, 0, -1), "hflip,vflip"),
        ((0, 1, 1, 0), "transpose=cclock_flip"),
        ((0, 1, -1, 0), "transpose=clock"),
        ((0, -1, -1, 0), "transpose=clock_flip"),
        ((0, -1, 1, 0), "transpose=cclock"),
    ],
)
def test_a_display_matrix_turns_and_mirrors_as_ffmpegs_filters_do(
    tmp_path: Path, display: tuple[int, int, int, int], as_ffmpeg: str
) -> None:
    path = write_video(tmp_path / "turned.mp4", 2, Recipe(size_px=(130, 82), display=display))
    is_mirrored = display[0] * display[3] - display[1] * display[2] < 0
    with av.open(str(path)) as container, open_source(path) as source:
        assert source.describe()["mirrored"] == is_mirrored
        assert any("mirrored" in warning for warning in source.warnings) == is_mirrored
        for stored, frame in zip(container.decode(video=0), source, strict=True):
            expected = filtered(stored, as_ffmpeg)
            assert frame.size_px == source.size_px == (expected.width, expected.height)
            assert np.abs(frame.image.astype(int) - expected.to_ndarray(format="bgr24")).mean() <= RESIZED_LEVELS


def filtered(frame: av.VideoFrame, filters: str) -> av.VideoFrame:
    """Return a frame as ffmpeg's filters make it."""
    graph = av.filter.Graph()
    steps = [graph.add(*step.split("=", 1)) for step in filters.split(",")]
    buffer = graph.add_buffer(
        width=frame.width, height=frame.height, format=frame.format.name, time_base=frame.time_base
    )
    graph.link_nodes(buffer, *steps, graph.add("buffersink")).configure()
    graph.push(frame)
    shown: av.VideoFrame = graph.pull()
    return shown


@pytest.mark.parametrize("suffix", ["mp4", "mkv", "ts"])
@pytest.mark.parametrize(("aspect", "size_px"), [((4, 3), (128, 64)), ((8, 9), (85, 64)), ((16, 15), (102, 64))])
def test_pixels_that_are_not_square_are_stretched_and_named(
    tmp_path: Path, suffix: str, aspect: tuple[int, int], size_px: tuple[int, int]
) -> None:
    path = write_video(tmp_path / f"wide.{suffix}", 3, Recipe(pixel_aspect=Fraction(*aspect)))
    with open_source(path) as source:
        assert source.size_px == size_px
        assert source.describe()["stored_size_px"] == [96, 64]
        assert source.describe()["pixel_aspect"] == f"{aspect[0]}/{aspect[1]}"
        assert source.warnings == (
            f"{path.name}: its pixels are not square; 96x64 are stretched to {size_px[0]}x{size_px[1]}",
        )
        frames = list(source)
    assert {frame.size_px for frame in frames} == {size_px}
    assert [index_in(frame.image) for frame in frames] == [0, 1, 2]


def test_pixels_of_no_format_are_refused(tmp_path: Path) -> None:
    path = write_video(tmp_path / "slit.mp4", 3, Recipe(pixel_aspect=Fraction(1, 90)))
    with pytest.raises(SourceError, match=r"pixels 1:90 wide in slit\.mp4"):
        open_source(path).describe()


def write_two_films(path: Path, sizes: Sequence[tuple[int, int]], default: Collection[int]) -> Path:
    """Write films of several sizes into one file; each carries 100 times its number, plus the frame's, as index."""
    with av.open(str(path), "w") as container:
        streams = []
        for number, size in enumerate(sizes):
            stream = container.add_stream("libx264", rate=10)
            stream.width, stream.height = size
            stream.pix_fmt = "yuv420p"
            stream.disposition = av.stream.Disposition.default if number in default else av.stream.Disposition(0)
            streams.append(stream)
        for index in range(10):
            for number, (stream, size) in enumerate(zip(streams, sizes, strict=True)):
                picture = coded_picture(100 * number + index, *size)
                frame = av.VideoFrame.from_ndarray(picture, format="bgr24").reformat(format="yuv420p")
                frame.pts, frame.time_base = index, Fraction(1, 10)
                container.mux(stream.encode(frame))
        for stream in streams:
            container.mux(stream.encode())
    return path


@pytest.mark.parametrize(
    ("sizes", "default", "chosen"),
    [
        ([(96, 64), (192, 128)], [1], 1),
        ([(96, 64), (192, 128)], [0, 1], 1),
        ([(96, 64), (192, 128)], [], 1),
        ([(192, 128), (96, 64)], [1], 1),
        ([(96, 64), (96, 64)], [], 0),
    ],
)
def test_of_several_films_the_main_one_is_read_and_the_others_are_named(
    tmp_path: Path, sizes: list[tuple[int, int]], default: list[int], chosen: int
) -> None:
    path = write_two_films(tmp_path / "two.mkv", sizes, default)
    with open_source(path, start_s=0.2) as source:
        assert source.size_px == sizes[chosen]
        assert [index_in(frame.image) for frame in source] == [100 * chosen + index for index in range(2, 10)]
        assert source.describe()["stream"] == chosen
        assert [stream["size_px"] for stream in source.describe()["streams"]] == [list(size) for size in sizes]
        assert "stream {} is read, not {} ({}x{})".format(chosen, 1 - chosen, *sizes[1 - chosen]) in source.warnings[0]


def rewrapped(path: Path, out: Path, times_s: Sequence[float], *, rising: bool = True) -> Path:
    """Copy a film without B-frames, with other times, of which Matroska takes any, rising or not."""
    with av.open(str(path)) as source, av.open(str(out), "w") as target:
        stream = target.add_stream_from_template(source.streams.video[0])
        packets = [packet for packet in source.demux(video=0) if packet.dts is not None]
        tick = Fraction(1, 90_000)
        for index, (packet, time_s) in enumerate(zip(packets, times_s, strict=True)):
            packet.time_base = tick
            packet.pts = packet.dts = round(Fraction(time_s) / tick)
            if not rising:
                packet.dts = index - len(packets)
            packet.duration = 0
            packet.stream = stream
            target.mux_one(packet)
    return out


@pytest.fixture(scope="module")
def plain_film(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_video(tmp_path_factory.mktemp("plain") / "plain.mkv", 20, Recipe(options={"g": "5", "bf": "0"}))


@pytest.mark.parametrize("start_s", [0.0, 0.85])
@pytest.mark.parametrize(("suffix", "later_s"), [("mkv", 0.0), ("ts", 1 / 90_000), ("mp4", 30e-6), ("mp4", 7e-4)])
def test_a_time_that_is_repeated_or_microseconds_later_costs_one_frame_and_is_named(
    tmp_path: Path, plain_film: Path, suffix: str, later_s: float, start_s: float
) -> None:
    times_s = [index / 10 for index in range(20)]
    times_s[13] = times_s[12] + later_s
    path = rewrapped(plain_film, tmp_path / f"double.{suffix}", times_s)
    with open_source(path, start_s=start_s) as source:
        frames = list(source)
        assert source.describe()["skipped_frames"] == 1
        assert any("1 frame is skipped" in warning and "at frame 13" in warning for warning in source.warnings)
    expected = [index for index in range(20) if index != 13 and index >= 10 * start_s]
    assert [frame.index for frame in frames] == [index_in(frame.image) for frame in frames] == expected
    assert [frame.time_s for frame in frames] == pytest.approx([index / 10 for index in expected], abs=1e-4)


@pytest.mark.parametrize("late_s", [0.1, 0.05, 0.3])
def test_a_time_before_the_last_costs_one_frame(late_s: float) -> None:
    times = RisingTimes("film.mp4")
    times_s = [index / 10 for index in range(20)]
    times_s[9] = times_s[8] - late_s
    assert [index for index, time_s in enumerate(times_s) if not times.passes(time_s, f"frame {index}")] == [9]
    assert times.skipped == 1
    assert "at frame 9" in times.warnings[0]


def shown_by(times_s: list[float]) -> tuple[list[int], RisingTimes]:
    times = RisingTimes("film.mp4")
    labelled = [(time_s, f"frame {index}", index) for index, time_s in enumerate(times_s)]
    return [index for _, index in times.in_order(labelled)], times


@pytest.mark.parametrize("where", [0, 1, 4, 8, 9])
@pytest.mark.parametrize("wrong_s", [30.0, 0.95, 0.0, -7.0])
def test_one_wrong_time_costs_one_frame_wherever_it_is(where: int, wrong_s: float) -> None:
    times_s = [index / 10 for index in range(10)]
    times_s[where] = wrong_s
    if sorted(times_s) == times_s and len(set(times_s)) == len(times_s):
        pytest.skip("a gap, or a later end, as films have")
    passed, times = shown_by(times_s)
    # Of two last frames, and of two of which the earlier is a bit late, nobody can say which is wrong.
    assert len(passed) == 9
    if where not in (8, 9) and not (where == 1 and wrong_s == 0.0):
        assert passed == [index for index in range(10) if index != where]
        assert f"at frame {where}" in times.warnings[0]


def test_a_clock_that_begins_anew_is_named() -> None:
    with pytest.raises(SourceError, match=r"0\.000 s after 0\.900 s at frame 10 of film\.mp4, and on from there"):
        shown_by([index / 10 for index in range(10)] * 2)
    _, times = shown_by([0.0, 0.1, 0.2, 0.3, 0.0, 0.1, 0.2])
    with pytest.raises(SourceError, match="at frame 4"):
        times.check_end()
    _, times = shown_by([0.0, 0.1, 0.2, 0.3, 0.0])
    times.check_end()


@pytest.mark.parametrize(("start_s", "expected"), [(0.0, list(range(1, 20))), (0.85, list(range(10, 20)))])
def test_a_wrong_first_time_costs_the_first_frame(
    tmp_path: Path, plain_film: Path, start_s: float, expected: list[int]
) -> None:
    times_s = [1.05, *(index / 10 for index in range(1, 20))]
    path = rewrapped(plain_film, tmp_path / "late.mkv", times_s, rising=False)
    with open_source(path, start_s=start_s) as source:
        frames = list(source)
        assert any("1 frame is skipped" in warning and "at frame 0" in warning for warning in source.warnings)
    assert [frame.index for frame in frames] == [index_in(frame.image) for frame in frames] == expected
    assert [frame.time_s for frame in frames] == pytest.approx([index / 10 - 0.1 for index in expected], abs=1e-4)


def test_a_film_whose_clock_begins_anew_is_refused_by_that(tmp_path: Path, plain_film: Path) -> None:
    times_s = [index % 16 / 10 for index in range(20)]
    path = rewrapped(plain_film, tmp_path / "anew.mkv", times_s, rising=False)
    with open_source(path) as source, pytest.raises(SourceError, match=r"0\.000 s after 1\.500 s at frame 16"):
        list(source)


def test_a_film_with_every_frame_twice_has_each_once() -> None:
    times = RisingTimes("film.mp4")
    passed = [index for index in range(200) if times.passes(index // 2 / 25, f"frame {index}")]
    assert passed == list(range(0, 200, 2))
    assert times.warnings[0].startswith("film.mp4: 100 frames are skipped, of a time that is not later (0.000 s after")
    assert times.warnings[0].count("at frame") == 3


def test_every_camera_that_a_site_has_is_slow_enough() -> None:
    for rate_fps in (1, 25, 240, 960, 1000):
        times = RisingTimes("film.mkv")
        assert all(times.passes(round(index / rate_fps, 3), "") for index in range(1000))  # Matroska's milliseconds


@pytest.mark.parametrize("bframes", [0, 1, 3])
@pytest.mark.parametrize("ticks", [1, 2, 3])
def test_an_avi_gives_its_times_whatever_the_order_and_the_ticks_a_frame(
    tmp_path: Path, bframes: int, ticks: int
) -> None:
    options = {"x264-params": f"keyint=12:bframes={bframes}:b-adapt=0:scenecut=0"}
    path = tmp_path / "film.avi"
    with av.open(str(path), "w") as container:
        stream = container.add_stream("libx264", rate=25 * ticks, options=options)
        stream.width, stream.height, stream.pix_fmt = 96, 64, "yuv420p"
        for index in range(25):
            frame = av.VideoFrame.from_ndarray(coded_picture(index), format="bgr24").reformat(format="yuv420p")
            frame.pts, frame.time_base = index * ticks, Fraction(1, 25 * ticks)
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    with open_source(path) as source:
        frames = list(source)
        assert source.frame_count == 25
        assert source.describe()["skipped_frames"] == 0
    assert [index_in(frame.image) for frame in frames] == list(range(25))
    assert [frame.time_s for frame in frames] == pytest.approx([index / 25 for index in range(25)])
