"""A live address is one of a few kinds, and what it is asked with is never said aloud, whatever it is."""

from __future__ import annotations

from pathlib import Path
from random import Random
from urllib.parse import quote, quote_plus, unquote, urlsplit

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from mutations import damaged

from standoff.core.errors import SourceError
from standoff.stages.frames import PROTOCOLS, LiveAddress, masked

PASSWORDS = st.text(min_size=1, max_size=20)
IN_A_WORD = st.text(st.characters(exclude_categories=["Z", "C"]), min_size=1, max_size=20)
"""No space, no line end: in a text nobody knows where a word with spaces ends."""


@pytest.mark.parametrize("scheme", ["rtsp", "rtsps", "rtmp", "rtmps"])
@pytest.mark.parametrize("rest", ["10.0.0.5/live", "camera.example:8554/a/b?profile=1", "[fe80::1]:554/live", "h"])
def test_an_address_of_a_stream_is_kept_as_it_is(scheme: str, rest: str) -> None:
    address = LiveAddress.read(f"{scheme}://{rest}")
    assert (address.scheme, str(address), address.opened_as()) == (scheme, f"{scheme}://{rest}", f"{scheme}://{rest}")


@pytest.mark.parametrize(
    "address",
    [
        "",
        " ",
        "rtsp",
        "rtsp://",
        "replay://",
        "live",
        "/dev/video0",
        "film.mp4",
        "http://10.0.0.5/live",
        "https://10.0.0.5/live.m3u8",
        "file:///etc/passwd",
        "file:/etc/passwd",
        "subfile:,,start,0,end,9,,:/etc/passwd",
        "concat:/etc/passwd|/etc/shadow",
        "concat://a|b",
        "data:text/plain;base64,eA==",
        "data://x",
        "pipe:0",
        "fd:",
        "crypto:rtsp://10.0.0.5/live",
        "async:rtsp://10.0.0.5/live",
        "tcp://10.0.0.5:554",
        "udp://239.0.0.1:1234",
        "srt://10.0.0.5:9000",
        "RTSP://10.0.0.5/live",
        " rtsp://10.0.0.5/live",
        "rtsp://10.0.0.5/live ",
        "rtsp://10.0.0.5/li ve",
        "rtsp://10.0.0.5/live\n",
        "rtsp://10.0.0.5/\tlive",
        "rtsp://10.0.0.5/\x00live",
        "replay://film\x00.mp4",
        "rtsp:///live",
        "rtsp://:554/live",
        "rtsp://10.0.0.5:port/live",
        "rtsp://10.0.0.5:99999/live",
        "rtsp://[::1/live",
        "rtsp://@10.0.0.5/live",
        "rtsp://anna@10.0.0.5/live",
        "rtsp://anna:@10.0.0.5/live",
    ],
)
def test_whatever_reads_this_machine_or_is_no_address_is_refused(address: str) -> None:
    with pytest.raises(SourceError) as raised:
        LiveAddress.read(address)
    assert "\n" not in str(raised.value) and raised.value.found


def test_only_a_film_that_is_replayed_may_read_files() -> None:
    for scheme, protocols in PROTOCOLS.items():
        allowed = protocols.split(",")
        assert scheme == "replay" or not {"file", "concat", "subfile", "data", "pipe", "http", "https"} & set(allowed)
    assert PROTOCOLS["replay"] == "file"


@pytest.mark.parametrize("rest", ["/a/film.mp4", "concat:/etc/passwd|x", "http://10.0.0.5/film.mp4", "a b.mp4"])
def test_a_film_is_opened_as_a_file_and_as_nothing_else(rest: str) -> None:
    address = LiveAddress.read(f"replay://{rest}")
    assert address.opened_as().startswith("file:")
    assert address.path == Path(unquote(rest))


@given(IN_A_WORD, PASSWORDS)
def test_what_libav_is_given_says_user_and_password_and_nothing_else_does(user: str, password: str) -> None:
    address = LiveAddress.read("rtsp://10.0.0.5:554/live?x=1", user, password)
    opened = urlsplit(address.opened_as())
    assert (unquote(opened.username or ""), unquote(opened.password or "")) == (user, password)
    assert (opened.hostname, opened.port, opened.path, opened.query) == ("10.0.0.5", 554, "/live", "x=1")
    other = LiveAddress.read("rtsp://10.0.0.5:554/live?x=1", user, f"another {password}")
    assert str(address) == str(other) and repr(address) == repr(other)


def rest_of(text: str, secret: str) -> str:
    """Assume that a secret is no part of what stands around it, which says nothing about it."""
    assume(secret not in text and quote(secret, safe="") not in text)
    return text


@given(PASSWORDS)
def test_a_text_with_a_known_password_is_the_same_text_whatever_the_password(password: str) -> None:
    around = rest_of("cannot open rtsp://anna:***@10.0.0.5/live, 401", password)
    for shape in (password, quote(password, safe=""), quote(password), quote_plus(password)):
        text = f"cannot open rtsp://anna:{shape}@10.0.0.5/live, 401"
        assert masked(text, password) == masked(around)
        assert masked(f"<{shape}> is wrong", password) == "<***> is wrong"


def test_a_password_that_is_no_text_is_sent_as_its_bytes_and_hidden() -> None:
    address = LiveAddress.read("rtsp://10.0.0.5/live", "anna", "p\udcff")
    assert address.opened_as() == "rtsp://anna:p%FF@10.0.0.5/live"
    assert address.masked("p\udcff or p%FF") == "*** or ***"


@given(IN_A_WORD)
def test_credentials_in_an_address_are_hidden_though_nobody_knows_them(password: str) -> None:
    for shape in (password, quote(password, safe="")):
        text = f"cannot open rtsp://anna:{shape}@10.0.0.5/live, 401"
        assert masked(text) == "cannot open rtsp://***@10.0.0.5/live, 401"


@pytest.mark.parametrize(
    "name",
    ["token", "access_token", "Password", "passwd", "pwd", "api-key", "apikey", "secret", "auth", "sig", "signature"],
)
def test_what_a_query_calls_a_secret_is_hidden(name: str) -> None:
    told = masked(f"cannot open rtmp://10.0.0.5/live?{name}=hunter2&fps=25, 403")
    assert told == f"cannot open rtmp://10.0.0.5/live?{name}=***&fps=25, 403"


@given(PASSWORDS, PASSWORDS)
def test_of_two_secrets_the_one_within_the_other_leaves_nothing(one: str, other: str) -> None:
    long = one + other + one
    assume(long not in "<*** is wrong>")
    for secrets in ((one, long), (long, one)):
        told = masked(f"{long}", *secrets)
        assert told == "***", told


@given(
    PASSWORDS, st.sampled_from(["rtsp://anna:{}@10.0.0.5/live", "anna:{}@10.0.0.5", "http://anna:{}@h/x", "rtsp:{}@h"])
)
def test_an_address_with_credentials_is_refused_without_them(password: str, shape: str) -> None:
    told = []
    for given_password in (password, "hunter2"):
        try:
            LiveAddress.read(shape.format(given_password))
        except SourceError as refused:
            told.append(refused.found)
        else:
            # Its part before a slash passed for a port: it is taken as it is, and shown to nobody.
            told.append(str(LiveAddress.read(shape.format(given_password))))
    assert told[0] == told[1]


def test_thousands_of_damaged_addresses_are_taken_or_refused_in_one_line() -> None:
    rng = Random(0)
    for _ in range(4000):
        original = rng.choice([b"rtsp://anna:hunter2@10.0.0.5:554/live", b"replay://film.mp4", b"rtmps://h/a?key=b"])
        text = damaged(rng, original).decode("utf-8", "surrogateescape")
        try:
            address = LiveAddress.read(text)
        except SourceError as refused:
            assert "\n" not in str(refused) and str(refused).startswith("expected ")
        else:
            assert address.scheme in PROTOCOLS and str(address).startswith(f"{address.scheme}://")
