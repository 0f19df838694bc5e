from __future__ import annotations

import math
import zipfile
from collections.abc import Collection, Sequence
from datetime import UTC, datetime, timedelta
from fractions import Fraction
from pathlib import Path

import av
import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from laws import examples
from stages.frames.coded_video import Recipe, coded_picture, index_in, write_video
from tolerances import RESIZED_LEVELS

from standoff.core.errors import FrameSizeChanged, SourceError, SourceTruncated
from standoff.core.types import Frame
from standoff.stages.frames import open_source
from standoff.stages.frames.times import RisingTimes

OPEN_GOP = Recipe(options={"x264-params": "open-gop=1:keyint=10:min-keyint=10:bframes=3:b-adapt=0:scenecut=0"})
RECIPES = {
    "h264.mp4": Recipe(),
    "h264.mkv": Recipe(seed=1),
    "h264.ts": Recipe(seed=2),
    "h264.avi": Recipe(seed=3),
    "open_gop.mp4": OPEN_GOP,
    "open_gop.ts": OPEN_GOP,
    "mpeg4.avi": Recipe(codec="mpeg4", size_px=(130, 82)),
    "mjpeg.mp4": Recipe(codec="mjpeg", pixel_format="yuvj420p", options={}),
    "variable.mp4": Recipe(times_ms=[37 * i + (i * i) % 30 for i in range(60)]),
    "variable.mkv": Recipe(times_ms=[37 * i + (i * i) % 30 for i in range(60)]),
}


@pytest.fixture(scope="module")
def videos(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("videos")
    return {name: write_video(folder / name, 60, recipe) for name, recipe in RECIPES.items()}


def read(path: Path, **selection: float | None) -> list[Frame]:
    with open_source(path, **selection) as source:  # type: ignore[arg-type]
        return list(source)


@pytest.mark.parametrize("name", RECIPES)
def test_every_frame_comes_once_with_its_index_and_its_own_pixels(videos: dict[str, Path], name: str) -> None:
    frames = read(videos[name])
    assert [frame.index for frame in frames] == list(range(60))
    assert [index_in(frame.image) for frame in frames] == list(range(60))
    assert {frame.size_px for frame in frames} == {RECIPES[name].size_px}
    assert {frame.stream_id for frame in frames} == {Path(name).stem}


@pytest.mark.parametrize("name", RECIPES)
def test_times_are_the_presentation_timestamps_from_the_first_frame_on(videos: dict[str, Path], name: str) -> None:
    times_ms = RECIPES[name].times_ms or [100 * i for i in range(60)]
    assert [frame.time_s for frame in read(videos[name])] == pytest.approx([t / 1000 for t in times_ms], abs=1e-9)


@pytest.mark.live
@given(
    start_s=st.floats(0, 2.1), length_s=st.floats(0.11, 7), every=st.integers(1, 7), name=st.sampled_from([*RECIPES])
)
@examples(60)
def test_a_part_holds_the_same_frames_as_the_whole(
    videos: dict[str, Path], start_s: float, length_s: float, every: int, name: str
) -> None:
    whole = [frame for frame in read(videos[name]) if start_s - 1e-6 <= frame.time_s < start_s + length_s - 1e-6]
    part = read(videos[name], start_s=start_s, stop_s=start_s + length_s, every=every)
    assert [(f.index, f.time_s) for f in part] == [(f.index, f.time_s) for f in whole[::every]]
    assert all(np.array_equal(a.image, b.image) for a, b in zip(part, whole[::every], strict=True))


@pytest.mark.parametrize("name", RECIPES)
def test_two_parts_make_the_whole_and_limits_on_a_frame_are_exact(videos: dict[str, Path], name: str) -> None:
    cut_s = read(videos[name])[23].time_s
    first, second = read(videos[name], stop_s=cut_s), read(videos[name], start_s=cut_s)
    assert [frame.index for frame in first + second] == list(range(60))
    assert second[0].index == 23


@pytest.mark.parametrize("name", [name for name, recipe in RECIPES.items() if recipe.times_ms is None])
@pytest.mark.parametrize(
    ("start_s", "stop_s", "every"), [(0.0, None, 1), (0.0, None, 7), (1.25, None, 2), (0.3, 4.1, 3), (5.9, None, 1)]
)
def test_the_expected_count_is_exact_at_a_constant_rate(
    videos: dict[str, Path], name: str, start_s: float, stop_s: float | None, every: int
) -> None:
    with open_source(videos[name], start_s=start_s, stop_s=stop_s, every=every) as source:
        assert source.frame_count == len(list(source))


def test_a_given_rate_replaces_the_timestamps(videos: dict[str, Path]) -> None:
    frames = read(videos["variable.mp4"], fps=5.0, start_s=2.0, stop_s=4.0)
    assert [frame.index for frame in frames] == list(range(10, 20))
    assert [frame.time_s for frame in frames] == [index / 5 for index in range(10, 20)]
    assert [index_in(frame.image) for frame in frames] == list(range(10, 20))


def test_a_raw_stream_without_timestamps_asks_for_a_rate(tmp_path: Path) -> None:
    path = write_video(tmp_path / "raw.h264", 20)
    with pytest.raises(SourceError, match=r"a timestamp on every frame.*--fps"):
        read(path)
    assert [index_in(frame.image) for frame in read(path, fps=10.0)] == list(range(20))


def test_timestamps_that_go_back_are_an_error(tmp_path: Path) -> None:
    a, b = write_video(tmp_path / "a.ts", 20), write_video(tmp_path / "b.ts", 20)
    joined = tmp_path / "joined.ts"
    joined.write_bytes(a.read_bytes() + b.read_bytes())
    with open_source(joined) as source, pytest.raises(SourceError, match="timestamps that increase") as caught:
        list(source)
    assert "frame 20 of joined.ts" in str(caught.value)


@pytest.mark.parametrize("rotation_deg", [90, -90, 180])
def test_rotation_metadata_turn_the_pictures_as_opencv_does(tmp_path: Path, rotation_deg: int) -> None:
    path = write_video(tmp_path / "turned.mp4", 3, Recipe(size_px=(130, 82), rotation_deg=rotation_deg))
    capture = cv2.VideoCapture(str(path))
    for frame in read(path):
        _, expected = capture.read()
        assert np.array_equal(frame.image, expected)
        assert frame.size_px == (expected.shape[1], expected.shape[0])
    with open_source(path) as source:
        assert source.size_px == ((130, 82) if abs(rotation_deg) == 180 else (82, 130))
        assert abs(source.description["rotation_deg"]) == abs(rotation_deg)


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
        assert source.description["mirrored"] == is_mirrored
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
        assert source.description["stored_size_px"] == [96, 64]
        assert source.description["pixel_aspect"] == f"{aspect[0]}/{aspect[1]}"
        assert source.warnings == (
            f"{path.name}: its pixels are not square; 96x64 are stretched to {size_px[0]}x{size_px[1]}",
        )
        frames = list(source)
    assert {frame.size_px for frame in frames} == {size_px}
    assert [index_in(frame.image) for frame in frames] == [0, 1, 2]


def test_pixels_of_no_format_are_refused(tmp_path: Path) -> None:
    path = write_video(tmp_path / "slit.mp4", 3, Recipe(pixel_aspect=Fraction(1, 90)))
    with pytest.raises(SourceError, match=r"pixels 1:90 wide in slit\.mp4"):
        open_source(path)


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
        assert source.description["stream"] == chosen
        assert [stream["size_px"] for stream in source.description["streams"]] == [list(size) for size in sizes]
        assert "stream {} is read, not {} ({}x{})".format(chosen, 1 - chosen, *sizes[1 - chosen]) in source.warnings[0]


def rewrapped(path: Path, out: Path, times_s: Sequence[float]) -> Path:
    """Copy a film without B-frames, with other times."""
    with av.open(str(path)) as source, av.open(str(out), "w") as target:
        stream = target.add_stream_from_template(source.streams.video[0])
        packets = [packet for packet in source.demux(video=0) if packet.dts is not None]
        tick = Fraction(1, 90_000)
        for packet, time_s in zip(packets, times_s, strict=True):
            packet.time_base = tick
            packet.pts = packet.dts = round(Fraction(time_s) / tick)
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
        assert source.description["skipped_frames"] == 1
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
        assert source.description["skipped_frames"] == 0
    assert [index_in(frame.image) for frame in frames] == list(range(25))
    assert [frame.time_s for frame in frames] == pytest.approx([index / 25 for index in range(25)])


def test_frames_tell_when_they_were_captured_if_the_file_does(tmp_path: Path) -> None:
    recipe = Recipe(metadata={"creation_time": "2026-03-04T05:06:07.000000Z"})
    frames = read(write_video(tmp_path / "dated.mp4", 5, recipe))
    assert [frame.captured_at for frame in frames] == [
        datetime(2026, 3, 4, 5, 6, 7, tzinfo=UTC) + timedelta(seconds=i / 10) for i in range(5)
    ]
    assert read(write_video(tmp_path / "undated.mp4", 2))[0].captured_at is None


def test_a_name_that_looks_like_a_protocol_or_a_pattern_is_a_plain_name(tmp_path: Path) -> None:
    path = write_video(tmp_path / "v.mp4", 5)
    for name in ("cam:1.mp4", "http:%03d.mp4"):
        assert len(read(path.rename(tmp_path / name))) == 5
        path = tmp_path / name


def test_frames_stay_valid_after_the_source_is_closed(videos: dict[str, Path]) -> None:
    frames = read(videos["h264.mp4"])
    assert [index_in(frame.picture.resized_bgr(96, 64)) for frame in frames] == list(range(60))


@pytest.mark.live
def test_the_surveyed_public_video_reads_as_opencv_reads_it(shared_data: Path) -> None:
    path = shared_data / "pets2009" / "vtest.avi"
    capture = cv2.VideoCapture(str(path))
    with open_source(path) as source:
        assert (source.size_px, source.frame_count) == ((768, 576), 795)
        frames = []
        for frame in source:
            frames.append(frame.index)
            ok, expected = capture.read()
            assert ok
            if frame.index % 50 == 0:
                assert np.array_equal(frame.image, expected)
            assert frame.time_s == pytest.approx(frame.index / 10)
        assert frames == list(range(795))
        assert source.description["corrupt_frames"] == 0
    assert [frame.index for frame in read(path, start_s=38.8, stop_s=39.3, every=2)] == [388, 390, 392]


# --- bad input ---


def test_files_that_are_no_videos_are_named_in_one_line(tmp_path: Path) -> None:
    (tmp_path / "empty.mp4").touch()
    (tmp_path / "notes.txt").write_text("a text file\n" * 50)
    (tmp_path / "text.mp4").write_text("a text file\n" * 50)
    (tmp_path / "noise.avi").write_bytes(np.random.default_rng(0).bytes(50_000))
    with zipfile.ZipFile(tmp_path / "archive.zip", "w") as archive:
        archive.writestr("a", "b" * 5000)
    expected = {
        "empty.mp4": "which is empty",
        "notes.txt": "which holds text",
        "text.mp4": "which no reader recognises",
        "noise.avi": "which no reader recognises",
        "archive.zip": "which no reader recognises",
        "missing.mp4": "found nothing at",
    }
    for address in ("rtsp://10.0.0.7:554/live", "rtmp://relay/drone", "https://site/film.mp4"):
        with pytest.raises(SourceError, match="address of a stream"):
            open_source(address)
    for name, found in expected.items():
        with pytest.raises(SourceError, match=found) as caught:
            open_source(tmp_path / name)
        assert "\n" not in str(caught.value)
        assert name in str(caught.value)


def test_a_sound_file_is_no_video(tmp_path: Path) -> None:
    path = tmp_path / "sound.wav"
    with av.open(str(path), "w") as container:
        stream = container.add_stream("pcm_s16le", rate=8000, layout="mono")
        frame = av.AudioFrame.from_ndarray(np.zeros((1, 8000), np.int16), format="s16", layout="mono")
        frame.sample_rate = 8000
        container.mux(stream.encode(frame))
    with pytest.raises(SourceError, match=r"sound\.wav, which holds audio and no video"):
        open_source(path)


def test_an_mp4_without_its_table_of_frames_is_truncated(tmp_path: Path) -> None:
    path = write_video(tmp_path / "cut.mp4", 60)
    path.write_bytes(path.read_bytes()[:-1500])
    with pytest.raises(SourceTruncated, match="moov"):
        open_source(path)


@pytest.mark.parametrize("kept", [0.4, 0.7, 0.9])
@pytest.mark.parametrize("name", ["fast.mp4", "h264.avi", "mpeg4.avi", "h264.mkv"])
def test_a_file_cut_short_yields_what_is_there_and_then_says_so(tmp_path: Path, name: str, kept: float) -> None:
    codec = "mpeg4" if name.startswith("mpeg4") else "libx264"
    muxer_options = {"movflags": "faststart"} if name == "fast.mp4" else {}
    recipe = Recipe(codec=codec, size_px=(320, 240), options={"g": "5", "bf": "2"}, muxer_options=muxer_options)
    path = write_video(tmp_path / name, 60, recipe)
    content = path.read_bytes()
    path.write_bytes(content[: int(len(content) * kept)])
    frames: list[Frame] = []
    with open_source(path) as source, pytest.raises(SourceTruncated, match="as its header says") as caught:
        frames.extend(source)
    assert 0 < len(frames) < 60
    assert f"the end after {len(frames)} frames" in str(caught.value)
    assert [index_in(frame.image) for frame in frames[:-3]] == list(range(len(frames) - 3))


def test_a_cut_file_read_to_a_stop_before_the_cut_is_whole(tmp_path: Path) -> None:
    path = write_video(tmp_path / "fast.mp4", 60, Recipe(muxer_options={"movflags": "faststart"}))
    content = path.read_bytes()
    path.write_bytes(content[: int(len(content) * 0.8)])
    assert len(read(path, stop_s=2.0)) == 20
    with pytest.raises(SourceTruncated):
        open_source(path, start_s=5.8)


def test_a_hole_in_the_middle_is_bridged_and_counted(tmp_path: Path) -> None:
    recipe = Recipe(options={"g": "6", "bf": "0"}, muxer_options={"movflags": "faststart"})
    path = write_video(tmp_path / "hole.mp4", 60, recipe)
    content = bytearray(path.read_bytes())
    middle = len(content) * 6 // 10
    content[middle : middle + 500] = bytes(500)
    path.write_bytes(content)
    with open_source(path) as source:
        frames = list(source)
        assert source.description["corrupt_frames"] > 0
    assert 30 < len(frames) <= 60
    assert frames[-1].time_s == pytest.approx(5.9)


def test_a_video_without_one_picture_that_can_be_decoded_is_none(tmp_path: Path) -> None:
    path = write_video(tmp_path / "zeros.mp4", 20, Recipe(muxer_options={"movflags": "faststart"}))
    content = bytearray(path.read_bytes())
    start = content.index(b"mdat") + 4
    content[start:] = bytes(len(content) - start)
    path.write_bytes(content)
    with pytest.raises(SourceError, match="not one picture of which can be decoded"):
        open_source(path)


def test_a_crooked_rotation_is_refused(tmp_path: Path) -> None:
    path = write_video(tmp_path / "crooked.mp4", 2, Recipe(rotation_deg=45))
    with pytest.raises(SourceError, match=r"crooked\.mp4, turned by 45 degrees"):
        open_source(path)


def test_a_file_that_decodes_no_more_stops_and_says_so(tmp_path: Path) -> None:
    recipe = Recipe(options={"g": "300", "bf": "0"}, muxer_options={"movflags": "faststart"})
    path = write_video(tmp_path / "zeros.mp4", 250, recipe)
    content = bytearray(path.read_bytes())
    content[len(content) * 6 // 10 :] = bytes(len(content) - len(content) * 6 // 10)
    path.write_bytes(content)
    with open_source(path) as source, pytest.raises(SourceTruncated, match="that cannot be decoded"):
        list(source)


@pytest.mark.parametrize("first_index", [0, 30])
def test_a_change_of_size_is_an_error_at_its_frame(tmp_path: Path, first_index: int) -> None:
    small = write_video(tmp_path / "small.ts", 30)
    large = write_video(tmp_path / "large.ts", 30, Recipe(size_px=(128, 96), first_index=first_index))
    joined = tmp_path / "joined.ts"
    joined.write_bytes(small.read_bytes() + large.read_bytes())
    frames: list[Frame] = []
    with open_source(joined) as source, pytest.raises(FrameSizeChanged) as caught:
        frames.extend(source)
    assert [index_in(frame.image) for frame in frames] == list(range(30))
    assert "pictures of 96x64" in str(caught.value)
    assert "128x96 at frame 30" in str(caught.value)


def test_parts_that_no_source_has_are_refused(videos: dict[str, Path]) -> None:
    path = videos["h264.mp4"]
    for selection, words in (
        ({"start_s": 6.0}, "it lasts about 6.0 s"),
        ({"start_s": 60.0}, "expected pictures from 60.0 s on, found none"),
        ({"start_s": -1.0}, "a start of 0 s or later"),
        ({"start_s": math.nan}, "a start of 0 s or later"),
        ({"start_s": 2.0, "stop_s": 2.0}, "a stop after the start"),
        ({"start_s": 2.01, "stop_s": 2.05}, "to stop before 2.05 s"),
        ({"every": 0}, "every 1 or more"),
        ({"fps": 0.0}, "more than 0 pictures a second"),
    ):
        with pytest.raises(SourceError, match=words):
            open_source(path, **selection)


def test_an_edit_list_that_drops_pictures_is_no_truncation(tmp_path: Path) -> None:
    path = write_video(tmp_path / "whole.mp4", 60, Recipe(options={"g": "30", "bf": "0"}))
    trimmed = tmp_path / "trimmed.mp4"
    with av.open(str(path)) as source, av.open(str(trimmed), "w") as target:
        stream = target.add_stream_from_template(source.streams.video[0])
        for packet in source.demux(video=0):
            if packet.dts is None:
                continue
            shift = int(Fraction(8, 10) / packet.time_base)
            packet.pts, packet.dts, packet.stream = packet.pts - shift, packet.dts - shift, stream
            target.mux(packet)
    assert [index_in(frame.image) for frame in read(trimmed)][-1] == 59


def test_a_matroska_clock_that_starts_late_is_no_truncation(tmp_path: Path) -> None:
    path = write_video(tmp_path / "late.mkv", 20, Recipe(times_ms=[600_000 + 100 * i for i in range(20)]))
    frames = read(path)
    assert [frame.time_s for frame in frames] == pytest.approx([0.1 * i for i in range(20)])
