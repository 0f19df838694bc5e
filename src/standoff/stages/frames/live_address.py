"""Where a live stream is, and what of it may be said aloud."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final, Self
from urllib.parse import quote, unquote, urlsplit

from standoff.core.errors import SourceError

PROTOCOLS: Final = {
    "rtsp": "rtsp,rtp,tcp",
    "rtsps": "rtsps,rtsp,rtp,tls,tcp",
    "rtmp": "rtmp,tcp",
    "rtmps": "rtmps,rtmp,tls,tcp",
    "replay": "file",
}
"""By the scheme of an address: what libav may open for it. Nothing else: `file:` and `concat:` read this machine."""

_CREDENTIALS = re.compile(r"(?<=://)[^/@\s]*@")
_SECRETS = re.compile(r"(?i)\b(pass(?:word)?|pwd|token|key|secret|auth)=[^&\s]+")


def masked(text: str, *secrets: str) -> str:
    """Return a text without credentials: those of addresses in it, and the secrets that are given.

    >>> masked("cannot open rtsp://anna:p4ss@10.0.0.5/live?token=abc", "p4ss")
    'cannot open rtsp://***@10.0.0.5/live?token=***'
    """
    for secret in filter(None, secrets):
        for shape in (secret, quote(secret, safe="")):
            text = text.replace(shape, "***")
    return _SECRETS.sub(r"\1=***", _CREDENTIALS.sub("***@", text))


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
        if (
            scheme not in PROTOCOLS
            or not rest
            or (any(sign.isspace() for sign in address.strip()) and scheme != "replay")
        ):
            raise SourceError(
                expected=f"an address that begins with {', '.join(f'{one}://' for one in PROTOCOLS)}",
                found=masked(address) or "nothing",
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
            raise SourceError(expected="a host in the address", found=masked(address), fix="write rtsp://host/path")
        if parts.username is not None or parts.password is not None:
            raise SourceError(
                expected="an address without credentials",
                found=masked(address),
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
        return f"{before}://{quote(self.user, safe='')}:{quote(self.password, safe='')}@{after}"

    def masked(self, text: str) -> str:
        """Return a text without this address's credentials."""
        return masked(text, self.password)

    def __str__(self) -> str:
        return masked(self.address)
