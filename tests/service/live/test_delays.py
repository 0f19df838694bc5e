"""What was measured of a stream is kept until it is measured again, and a damaged file says so and is replaced."""

from __future__ import annotations

from pathlib import Path
from random import Random

import pytest
from mutations import damaged

from standoff.core.errors import DataError
from standoff.service.live.delays import MeasuredDelay, keep_delay, read_delays

MEASURED = MeasuredDelay(0.31, 0.55, 40, "rtsp://10.0.0.5/live", "2026-03-02T10:00:00+00:00")


def test_nobody_measured_is_no_delay(tmp_path: Path) -> None:
    assert read_delays(tmp_path) == {}


def test_each_stream_has_what_was_measured_last(tmp_path: Path) -> None:
    other = MeasuredDelay(1.0, 1.2, 3, "rtmp://h/a", "2026-03-03T10:00:00+00:00")
    assert keep_delay(tmp_path, "gate", other) == other
    keep_delay(tmp_path, "crane", other)
    keep_delay(tmp_path, "gate", MEASURED)
    assert read_delays(tmp_path) == {"gate": MEASURED, "crane": other}


@pytest.mark.parametrize(
    "content",
    [b"", b"{", b"[]", b"5", b'{"gate": 5}', b'{"gate": {}}', b'{"gate": {"delay_s": 0.3}}', b"\xff\xfe",
     b'{"gate": {"delay_s": "0.3", "worst_s": 1, "pictures": 1, "address": "", "measured_at": ""}}',
     b'{"gate": {"delay_s": -0.1, "worst_s": 1, "pictures": 1, "address": "", "measured_at": ""}}',
     b'{"gate": {"delay_s": NaN, "worst_s": 1, "pictures": 1, "address": "", "measured_at": ""}}',
     b'{"gate": {"delay_s": ' + b"9" * 400 + b', "worst_s": 1, "pictures": 1, "address": "", "measured_at": ""}}',
     b'{"gate": {"delay_s": 1, "worst_s": 1, "pictures": 1, "address": "", "measured_at": "", "more": 1}}'],
)  # fmt: skip
def test_a_damaged_file_is_told_and_measuring_again_mends_it(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "delays.json").write_bytes(content)
    with pytest.raises(DataError) as raised:
        read_delays(tmp_path)
    assert "\n" not in str(raised.value)
    keep_delay(tmp_path, "gate", MEASURED)
    assert read_delays(tmp_path) == {"gate": MEASURED}


def test_no_damage_is_taken_for_a_delay_that_cannot_be(tmp_path: Path) -> None:
    rng = Random(0)
    keep_delay(tmp_path, "gate", MEASURED)
    whole = (tmp_path / "delays.json").read_bytes()
    for _ in range(150):
        (tmp_path / "delays.json").write_bytes(damaged(rng, whole, b"null", b"1e999", b"9" * 400, b"[]"))
        try:
            found = read_delays(tmp_path)
        except DataError as refused:
            assert "\n" not in str(refused)
        else:
            assert all(0.0 <= one.delay_s < float("inf") for one in found.values())
