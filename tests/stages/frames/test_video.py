from __future__ import annotations

import math
import zipfile
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
from stages.frames.coded_video import Recipe, index_in, write_video

from standoff.core.errors import FrameSizeChanged, SourceError, SourceTruncated
from standoff.core.types import Frame
from standoff.stages.frames import open_source

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
        assert abs(source.describe()["rotation_deg"]) == abs(rotation_deg)


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
        assert source.describe()["corrupt_frames"] == 0
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
            open_source(tmp_path / name).describe()
        assert "\n" not in str(caught.value)
        assert name in str(caught.value)


def test_the_address_of_a_file_is_that_file(tmp_path: Path) -> None:
    path = write_video(tmp_path / "site 1.mp4", 3, Recipe())
    for address in (path.as_uri(), path.as_uri().replace("///", "/"), path.as_uri().replace("///", "//localhost/")):
        with open_source(address) as source:
            assert (len(list(source)), source.stream_id) == (3, "site 1")
        # As the command line gives it.
        open_source(Path(address)).close()
    with pytest.raises(SourceError, match=r"nothing at /.*missing\.mp4"):
        open_source((tmp_path / "missing.mp4").as_uri()).describe()


def test_a_sound_file_is_no_video(tmp_path: Path) -> None:
    path = tmp_path / "sound.wav"
    with av.open(str(path), "w") as container:
        stream = container.add_stream("pcm_s16le", rate=8000, layout="mono")
        frame = av.AudioFrame.from_ndarray(np.zeros((1, 8000), np.int16), format="s16", layout="mono")
        frame.sample_rate = 8000
        container.mux(stream.encode(frame))
    with pytest.raises(SourceError, match=r"sound\.wav, which holds audio and no video"):
        open_source(path).describe()


def test_an_mp4_without_its_table_of_frames_is_truncated(tmp_path: Path) -> None:
    path = write_video(tmp_path / "cut.mp4", 60)
    path.write_bytes(path.read_bytes()[:-1500])
    with pytest.raises(SourceTruncated, match="moov"):
        open_source(path).describe()


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
        open_source(path, start_s=5.8).describe()


def test_a_hole_in_the_middle_is_bridged_and_counted(tmp_path: Path) -> None:
    recipe = Recipe(options={"g": "6", "bf": "0"}, muxer_options={"movflags": "faststart"})
    path = write_video(tmp_path / "hole.mp4", 60, recipe)
    content = bytearray(path.read_bytes())
    middle = len(content) * 6 // 10
    content[middle : middle + 500] = bytes(500)
    path.write_bytes(content)
    with open_source(path) as source:
        frames = list(source)
        assert source.describe()["corrupt_frames"] > 0
    assert 30 < len(frames) <= 60
    assert frames[-1].time_s == pytest.approx(5.9)


def test_a_video_without_one_picture_that_can_be_decoded_is_none(tmp_path: Path) -> None:
    path = write_video(tmp_path / "zeros.mp4", 20, Recipe(muxer_options={"movflags": "faststart"}))
    content = bytearray(path.read_bytes())
    start = content.index(b"mdat") + 4
    content[start:] = bytes(len(content) - start)
    path.write_bytes(content)
    with pytest.raises(SourceError, match="not one picture of which can be decoded"):
        open_source(path).describe()


def test_a_crooked_rotation_is_refused(tmp_path: Path) -> None:
    path = write_video(tmp_path / "crooked.mp4", 2, Recipe(rotation_deg=45))
    with pytest.raises(SourceError, match=r"crooked\.mp4, turned by 45 degrees"):
        open_source(path).describe()


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
            open_source(path, **selection).describe()


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
