"""Where a live stream is, and what of it may be said aloud."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from functools import cache, partial
from pathlib import Path
from typing import Final, Self
from urllib.parse import quote, quote_plus, unquote, urlsplit

from standoff.core.errors import SourceError

PROTOCOLS: Final = {
    "rtsp": "rtsp,rtp,tcp",
    "rtsps": "rtsps,rtsp,rtp,tls,tcp",
    "rtmp": "rtmp,tcp",
    "rtmps": "rtmps,rtmp,tls,tcp",
    "replay": "file",
}
"""By the scheme of an address: what libav may open for it. Nothing else: `file:` and `concat:` read this machine."""

_CREDENTIALS = re.compile(r"(?<=://)\S*@")
"""Up to the last @ of a word: a password may hold any sign, though it should not."""
_SECRETS = re.compile(r"(?i)\b([\w-]*(?:pass(?:word|wd|phrase)?|pwd|token|key|secret|auth|sig(?:nature)?))=[^&\s]+")

_ANY_BYTES: Final = "surrogateescape"
"""A secret of the environment may be no UTF-8."""


def masked(text: str, *secrets: str) -> str:
    """Return a text without credentials: those of addresses in it, and the secrets that are given.

    >>> masked("cannot open rtsp://anna:p4ss@10.0.0.5/live?token=abc", "p4ss")
    'cannot open rtsp://***@10.0.0.5/live?token=***'
    """
    if any(secrets):
        text = _pattern_of(secrets).sub("***", text)
    return _SECRETS.sub(r"\1=***", _CREDENTIALS.sub("***@", text))


@cache
def _pattern_of(secrets: tuple[str, ...]) -> re.Pattern[str]:
    """Return what finds secrets, as they are and as they stand in addresses; of two that overlap the longer one."""
    encodings = (_encoded, partial(_encoded, safe="/"), partial(quote_plus, errors=_ANY_BYTES))
    shapes = {shape for one in filter(None, secrets) for shape in (one, *(encode(one) for encode in encodings))}
    return re.compile("|".join(re.escape(shape) for shape in sorted(shapes, key=len, reverse=True)))


def _encoded(secret: str, safe: str = "") -> str:
    return quote(secret, safe=safe, errors=_ANY_BYTES)


def _shown(address: str) -> str:
    """Return an address that is refused, for the message: all before its last @ may be credentials."""
    before, sign, after = address.rpartition("@")
    scheme, slashes, _ = before.partition("://")
    begin = f"{scheme}{slashes}" if slashes and scheme in PROTOCOLS else ""
    return masked(f"{begin}***@{after}" if sign else address)


def _has_odd_signs(address: str, *, is_film: bool) -> bool:
    """Return whether an address has signs that no address has; names of films may have more than others."""
    if is_film:
        return any(one == "\0" or "\ud800" <= one <= "\udfff" for one in address)
    return any(one.isspace() or not one.isprintable() for one in address)


@dataclass(frozen=True, slots=True)
class LiveAddress:
    """Where a live stream is.

    Attributes:
        scheme: One of `PROTOCOLS`.
        address: Without credentials; may be said to anybody.
        user: Who asks; empty: nobody in particular.
        password: Never shown.
        ca_file: Certificates that vouch for the sender; None: those of this machine.
    """

    scheme: str
    address: str
    user: str = ""
    password: str = field(default="", repr=False)
    ca_file: Path | None = None

    @classmethod
    def read(cls, address: str, user: str = "", password: str = "", ca_file: Path | None = None) -> Self:
        """Check an address.

        Args:
            address: As in a site's settings; `replay://` is followed by the path of a film.
            user: Who asks.
            password: Theirs.
            ca_file: As in `LiveAddress`.

        Raises:
            SourceError: Its scheme is none of `PROTOCOLS`, it has no host, or it holds a password.
        """
        scheme, _, rest = address.partition("://")
        if scheme not in PROTOCOLS or not rest or _has_odd_signs(address, is_film=scheme == "replay"):
            raise SourceError(
                expected=f"an address that begins with {', '.join(f'{one}://' for one in PROTOCOLS)}",
                found=_shown(address) or "nothing",
                fix="give the address of a stream, or of a film as replay://film.mp4",
            )
        if scheme == "replay":
            return cls(scheme, address)
        try:
            parts = urlsplit(address)
            host, _ = parts.hostname, parts.port
        except ValueError:
            host, parts = None, None
        if parts is None or not host:
            raise SourceError(expected="a host in the address", found=_shown(address), fix="write rtsp://host/path")
        if parts.username is not None or parts.password is not None:
            raise SourceError(
                expected="an address without credentials",
                found=_shown(address),
                fix="write `user:` and `password: env:NAME` beside the address, so that they are shown nowhere",
            )
        return cls(scheme, address, user, password, ca_file)

    @property
    def path(self) -> Path:
        """Of a film that is replayed."""
        return Path(unquote(self.address.partition("://")[2]))

    def opened_as(self) -> str:
        """Return what libav is given, credentials included: never to be logged."""
        if self.scheme == "replay":
            return f"file:{self.path}"
        if not self.user:
            return self.address
        before, _, after = self.address.partition("://")
        return f"{before}://{_encoded(self.user)}:{_encoded(self.password)}@{after}"

    def masked(self, text: str) -> str:
        """Return a text without this address's credentials."""
        return masked(text, self.password)

    def __str__(self) -> str:
        return masked(self.address)
