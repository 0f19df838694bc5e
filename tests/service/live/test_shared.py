"""What one process writes others read whole, newest only, or not at all."""

from __future__ import annotations

import zlib
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import av
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from laws import examples

from standoff.core.types import ImageArray
from standoff.service.live.shared import PictureSlot, SharedRecord

WORDS = st.dictionaries(
    st.text(max_size=8),
    st.none() | st.booleans() | st.integers(-(2**60), 2**60) | st.floats(allow_nan=False) | st.text(max_size=20),
    max_size=6,
)
EVEN = st.integers(1, 60).map(lambda half: 2 * half)


def planes_of(width_px: int, height_px: int, seed: int) -> ImageArray:
    planes: ImageArray = np.random.default_rng(seed).integers(0, 256, (height_px * 3 // 2, width_px), dtype=np.uint8)
    return planes


def frame_of(planes: ImageArray, kind: str = "yuv420p") -> av.VideoFrame:
    return av.VideoFrame.from_ndarray(planes, format=kind)


def luma_of(frame: av.VideoFrame) -> ImageArray:
    luma: ImageArray = frame.to_ndarray()[: frame.height]
    return luma


@examples(60)
@given(st.lists(WORDS, min_size=1, max_size=6))
def test_the_newest_words_are_read_as_they_were_written(said: list[dict[str, Any]]) -> None:
    with TemporaryDirectory() as folder:
        path = Path(folder) / "gate.record"
        early = SharedRecord(path, 4096)
        assert early.read() is None
        writer = SharedRecord(path, 4096)
        for words in said:
            writer.write(words)
            assert early.read() == words
        assert SharedRecord(path, 4096).read() == said[-1]


def test_words_that_do_not_fit_are_refused_and_those_before_stay(tmp_path: Path) -> None:
    record = SharedRecord(tmp_path / "record", 64)
    record.write({"a": 1})
    with pytest.raises(ValueError, match="do not fit into a record of 64"):
        record.write({"a": "x" * 64})
    assert record.read() == {"a": 1}
    record.write({"a": "x" * (64 - 8 - len('{"a":""}'))})
    assert record.read() == {"a": "x" * 48}


@pytest.mark.parametrize(
    ("place", "garbage"),
    [
        (0, b"\xff\xff\xff\xff"),
        (4, b"\xff\xff\xff\xff"),
        (4, b"\x01\x00\x00\x00"),
        (9, b"\x00"),
        (8, b"{{{{"),
        (0, b"\x55" * 4096),
    ],
)
def test_of_words_that_are_torn_the_ones_before_hold(tmp_path: Path, place: int, garbage: bytes) -> None:
    path = tmp_path / "record"
    writer, reader = SharedRecord(path, 4096), SharedRecord(path, 4096)
    writer.write({"beat_s": 1.0})
    assert reader.read() == {"beat_s": 1.0}
    writer.write({"beat_s": 2.0})
    with path.open("r+b") as file:
        file.seek(place)
        file.write(garbage)
    assert reader.read() == {"beat_s": 1.0}
    assert SharedRecord(path, 4096).read() is None
    writer.write({"beat_s": 3.0})
    assert reader.read() == {"beat_s": 3.0}


def test_a_writer_that_was_killed_between_the_words_and_their_head_leaves_the_old_words_unread_only_by_newcomers(
    tmp_path: Path,
) -> None:
    path = tmp_path / "record"
    writer, reader = SharedRecord(path, 4096), SharedRecord(path, 4096)
    writer.write({"frames": 10})
    reader.read()
    body = b'{"frames":11}'
    assert zlib.crc32(body) != zlib.crc32(b'{"frames":10}')
    with path.open("r+b") as file:
        file.seek(8)
        file.write(body)
    assert reader.read() == {"frames": 10}


@examples(60)
@given(st.lists(st.tuples(EVEN, EVEN, st.sampled_from(["yuv420p", "yuvj420p"])), min_size=1, max_size=8), st.booleans())
def test_the_newest_picture_is_read_as_it_was_put_in_whatever_its_size(
    kinds: list[tuple[int, int, str]], reads_each: bool
) -> None:
    with TemporaryDirectory() as folder, PictureSlot(Path(folder), "gate") as reader:
        assert reader.newest() is None and reader.about() is None
        writer = PictureSlot(Path(folder), "gate")
        for number, (width_px, height_px, kind) in enumerate(kinds, start=1):
            planes = planes_of(width_px, height_px, number)
            writer.put(frame_of(planes, kind), {"arrived_s": number})
            if not reads_each and number < len(kinds):
                continue
            taken = reader.newest()
            assert taken is not None
            assert (taken.number, taken.about) == (number, {"arrived_s": number})
            assert (taken.frame.width, taken.frame.height, taken.frame.format.name) == (width_px, height_px, kind)
            assert np.array_equal(taken.frame.to_ndarray(), planes)
            assert reader.about() == (number, {"arrived_s": number})
        writer.close()


@pytest.mark.parametrize("size_px", [(33, 18), (34, 17), (101, 51), (3, 3)])
def test_of_an_odd_size_the_last_column_or_row_is_left_out(tmp_path: Path, size_px: tuple[int, int]) -> None:
    gray = np.random.default_rng(2).integers(16, 236, size_px[::-1], dtype=np.uint8)
    with PictureSlot(tmp_path, "gate") as slot:
        slot.put(av.VideoFrame.from_ndarray(gray, format="gray"), {})
        taken = slot.newest()
    assert taken is not None
    assert (taken.frame.width, taken.frame.height) == (size_px[0] // 2 * 2, size_px[1] // 2 * 2)


def test_pictures_of_other_kinds_are_made_into_one_that_is_known(tmp_path: Path) -> None:
    grey = np.full((36, 64, 3), 127, np.uint8)
    with PictureSlot(tmp_path, "gate") as slot:
        slot.put(av.VideoFrame.from_ndarray(grey, format="bgr24"), {})
        taken = slot.newest()
    assert taken is not None and taken.frame.format.name == "yuv420p"
    assert np.abs(taken.frame.to_ndarray(format="bgr24").astype(int) - 127).max() <= 5


def test_a_picture_is_of_its_own_memory(tmp_path: Path) -> None:
    planes = planes_of(64, 36, 1)
    slot = PictureSlot(tmp_path, "gate")
    slot.put(frame_of(planes), {})
    taken = slot.newest()
    for seed in range(2, 8):
        slot.put(frame_of(planes_of(64, 36, seed)), {})
    slot.close()
    assert taken is not None and np.array_equal(taken.frame.to_ndarray(), planes)


def test_a_reader_that_is_late_sees_the_newest_and_none_that_was_overwritten(tmp_path: Path) -> None:
    writer, reader = PictureSlot(tmp_path, "gate"), PictureSlot(tmp_path, "gate")
    frames = [planes_of(64, 36, seed) for seed in range(10)]
    for planes in frames:
        writer.put(frame_of(planes), {})
    taken = reader.newest()
    assert taken is not None and taken.number == 10
    assert np.array_equal(luma_of(taken.frame), frames[-1][:36])


@pytest.mark.parametrize(("before", "after"), [((64, 36), (96, 54)), ((96, 54), (64, 36)), ((640, 360), (320, 240))])
@pytest.mark.parametrize("puts", range(1, 7))
def test_a_picture_that_was_overwritten_by_one_of_another_size_is_not_taken_for_whole(
    tmp_path: Path, before: tuple[int, int], after: tuple[int, int], puts: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    writer, reader = PictureSlot(tmp_path, "gate"), PictureSlot(tmp_path, "gate")
    for seed in range(puts):
        writer.put(frame_of(planes_of(*before, seed)), {})
    assert reader.newest() is not None
    stale = SharedRecord(tmp_path / "gate.picture", 4096).read()
    assert stale is not None
    fresh = planes_of(*after, 99)
    writer.put(frame_of(fresh), {})
    read = SharedRecord.read
    heads = iter([stale])
    monkeypatch.setattr(SharedRecord, "read", lambda record: next(heads, None) or read(record))
    taken = reader.newest()
    assert taken is not None
    assert np.array_equal(taken.frame.to_ndarray(), fresh if taken.number == puts + 1 else planes_of(*before, puts - 1))


def test_a_new_writer_goes_on_where_readers_look(tmp_path: Path) -> None:
    first, reader = PictureSlot(tmp_path, "gate"), PictureSlot(tmp_path, "gate")
    for seed in range(5):
        first.put(frame_of(planes_of(64, 36, seed)), {"connection": 1})
    reader.newest()
    second = PictureSlot(tmp_path, "gate")
    planes = planes_of(64, 36, 7)
    second.put(frame_of(planes), {"connection": 2})
    taken = reader.newest()
    assert taken is not None and (taken.number, taken.about) == (1, {"connection": 2})
    assert np.array_equal(taken.frame.to_ndarray(), planes)


def test_nobody_else_can_read_them(tmp_path: Path) -> None:
    slot = PictureSlot(tmp_path, "gate")
    slot.put(frame_of(planes_of(64, 36, 0)), {})
    assert {path.stat().st_mode & 0o777 for path in tmp_path.iterdir()} == {0o600}
