"""Flight logs and pictures as a bad copy leaves them: read, or refused by name."""

from __future__ import annotations

import io
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from laws import examples
from mutations import mutated
from PIL import Image

from standoff.core.errors import SourceError
from standoff.files.picture_header import UnreadablePicture, read_header, read_whole_header
from standoff.stages.frames import open_source
from standoff.stages.frames.flight_log import FlightLog, NoFlightLog, read_flight_log

_BRACKETED = """{0}
00:00:{0:02d},000 --> 00:00:{1:02d},000
<font size="28">FrameCnt: {0}, DiffTime: 1000ms
2024-12-03 16:19:{0:02d}.296
[iso: 110] [focal_len: 24.00] [latitude: 19.182447] [longitude: 73.260940] [rel_alt: 16.900 abs_alt: 102.265] \
[gb_yaw: 12.5 gb_pitch: -60.0 gb_roll: 0.0] [dzoom_ratio: 1.00] </font>

"""
_HOME = """{0}
00:00:{0:02d},000 --> 00:00:{1:02d},000
HOME(149.0251,-20.2533) 2017.08.05 14:11:{0:02d}
GPS(149.0251,-20.2533,16) BAROMETER:1.9
ISO:100 Shutter:60 EV: Fnum:2.2

"""
_LISTED = """{0}
00:00:{0:02d},000 --> 00:00:{1:02d},000
F/2.8, SS 206.14, ISO 150, EV 0, GPS (-122.3699, 37.8166, 15), D 75.36m, H 56.20m, H.S 11.16m/s, V.S 0.00m/s

"""


def log_text(dialect: str, blocks: int = 3) -> bytes:
    """Return a whole log."""
    return "".join(dialect.format(number, number + 1) for number in range(blocks)).encode()


LOGS = [log_text(dialect) for dialect in (_BRACKETED, _HOME, _LISTED)]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("fuzzed")


@pytest.mark.parametrize("whole", LOGS, ids=["bracketed", "home", "listed"])
def test_the_logs_here_are_whole_and_no_cut_gives_other_numbers(folder: Path, whole: bytes) -> None:
    path = folder / "film.srt"
    path.write_bytes(whole)
    log = read_flight_log(path)
    assert isinstance(log, FlightLog)
    assert len(log.values) == 3
    for end in range(0, len(whole), 7):
        path.write_bytes(whole[:end])
        cut = read_flight_log(path)
        if isinstance(cut, FlightLog):
            np.testing.assert_array_equal(cut.values, log.values[: len(cut.values)])
            assert cut.disagreements(log.end_s + 10, None)


@given(mutated(st.sampled_from(LOGS)))
@examples(200)
def test_a_flight_log_is_read_or_refused_by_name(folder: Path, content: bytes) -> None:
    path = folder / "film.srt"
    path.write_bytes(content)
    log = read_flight_log(path)
    if isinstance(log, NoFlightLog):
        assert str(log).startswith("film.srt")
        assert "\n" not in str(log)
        return
    assert (np.diff(log.time_s) > 0).all()
    assert math.isfinite(log.end_s)
    for time_s in (-1.0, 0.0, float(log.time_s[-1]), log.end_s + 1.0):
        log.at(time_s)
    log.disagreements(5.0, 150)


def _pictures() -> dict[str, bytes]:
    found = {}
    noise = np.random.default_rng(0).integers(0, 256, (12, 16, 3), dtype=np.uint8)
    for suffix, name in (("jpg", "JPEG"), ("png", "PNG"), ("webp", "WEBP"), ("bmp", "BMP"), ("tif", "TIFF")):
        exif = Image.Exif()
        exif[0x0112] = 6
        buffer = io.BytesIO()
        Image.fromarray(noise).save(buffer, name, **({} if name == "BMP" else {"exif": exif}))
        found[suffix] = buffer.getvalue()
    return found


PICTURES = _pictures()


@given(mutated(st.sampled_from(sorted(PICTURES.values()))))
@examples(100)
def test_a_picture_is_read_or_refused_by_name(folder: Path, content: bytes) -> None:
    path = folder / "pictures" / "1.jpg"
    path.parent.mkdir(exist_ok=True)
    path.write_bytes(content)
    try:
        assert min(read_header(path).size_px) > 0
    except UnreadablePicture as error:
        assert "1.jpg" not in str(error)
    try:
        with open_source(path.parent, fps=1) as source:
            assert [frame.size_px for frame in source] == [source.size_px]
    except SourceError as error:
        assert "1.jpg" in str(error)
        assert "\n" not in str(error)


@pytest.mark.parametrize("suffix", PICTURES)
def test_no_cut_picture_is_a_whole_one(folder: Path, suffix: str) -> None:
    whole = PICTURES[suffix]
    path = folder / f"cut.{suffix}"
    path.write_bytes(whole)
    assert read_whole_header(path).size_px == ((16, 12) if suffix == "bmp" else (12, 16))
    ends = {*range(0, len(whole), 7), *range(len(whole) - 3, len(whole))}
    # What a TIFF file says of itself may stand behind its pixels, and EXIF data behind a WebP's.
    for end in ends:
        path.write_bytes(whole[:end])
        with pytest.raises(UnreadablePicture):
            read_whole_header(path)
