"""A stream that comes from a film, and senders that are not there."""

from __future__ import annotations

import time
from importlib.resources import files
from itertools import islice, pairwise
from pathlib import Path

import pytest

from standoff.stages.frames import LiveAddress, LiveStream, StreamUnreachable

FILM = Path(str(files("standoff"))) / "demo" / "video.mp4"


def test_a_film_is_replayed_whole_and_at_its_own_pace() -> None:
    with LiveStream(LiveAddress.read(f"replay://{FILM}")) as stream:
        began_s = time.monotonic()
        pictures = list(islice(stream, 8))
        passed_s = time.monotonic() - began_s
    stamps = [one.stamp_s for one in pictures]
    assert all(later > earlier for earlier, later in pairwise(stamps))
    assert passed_s >= stamps[-1] - stamps[0] - 0.02
    assert {(one.frame.width, one.frame.height, one.told_unix_s) for one in pictures} == {(1920, 1080, None)}


@pytest.mark.parametrize("address", ["rtsp://127.0.0.1:9/none", "rtmp://127.0.0.1:9/none/x", "replay:///no/film.mp4"])
def test_a_sender_that_is_not_there_is_said_in_one_line(address: str) -> None:
    with pytest.raises(StreamUnreachable) as refused:
        LiveStream(
            LiveAddress.read(address, "anna", "s3cret") if "replay" not in address else LiveAddress.read(address)
        )
    assert "\n" not in str(refused.value) and "s3cret" not in str(refused.value)
