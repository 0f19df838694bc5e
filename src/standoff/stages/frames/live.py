"""A live stream through PyAV: opened quickly or not at all, each picture at once, and whose word its time is.

What was measured of libav (FFmpeg 8) and shapes this: opening hangs on silent peers unless PyAV's own `timeout` is
given; RTSP that sends no pictures opens all the same; a sender that is killed ends the stream without an error; threads
by frame delay pictures by several of them; key frames that come in several packets are read wrongly unless told so.
"""

from __future__ import annotations

import struct
import time
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, Self

import av
from av.codec.context import Flags2

from standoff.core.errors import SourceError
from standoff.stages.frames.live_address import PROTOCOLS, LiveAddress

if TYPE_CHECKING:
    from types import TracebackType

_OPEN_S: Final = 2.0
_READ_S: Final = 0.75
"""A silent sender is noticed after twice as long."""
_KEPT_TIMES: Final = 64
_DAMAGED_IN_A_ROW: Final = 50
_IN_PARTS: Final = ("rtsp", "rtsps")
_QUICK: Final = {"probesize": "32", "analyzeduration": "0"}
"""Without `nobuffer`: it drops what was probed, the first piece of the first key frame, and until the next one half of
every picture is wrong, not marked as damaged."""


class StreamRefused(SourceError):
    """The sender does not accept the credentials, or knows no such stream."""


class StreamUnreachable(SourceError):
    """Nothing comes from there at the moment."""


@dataclass(frozen=True, slots=True, eq=False)
class LivePicture:
    """One picture of a live stream.

    Attributes:
        frame: The decoded `av.VideoFrame`.
        stamp_s: Its presentation timestamp; begins anywhere in each connection.
        told_unix_s: When it was taken by the sender's own clock, seconds since 1970; None: it does not say.
    """

    frame: av.VideoFrame
    stamp_s: float
    told_unix_s: float | None


class LiveStream:
    """One connection to a live stream; iterate over it once.

    Args:
        address: Where it is.

    Raises:
        StreamRefused: The credentials, or the name of the stream, are not accepted.
        StreamUnreachable: Nobody answers in time, or sends no film.
    """

    def __init__(self, address: LiveAddress) -> None:
        self._address = address
        self._told: dict[int, float] = {}
        self.damaged = 0
        try:
            self._container = av.open(
                address.opened_as(), options=_options(address), timeout=(_OPEN_S, _READ_S), metadata_errors="replace"
            )
        except (av.FFmpegError, OSError, ValueError) as error:
            raise self._refusal(error) from None
        if not self._container.streams.video:
            self._container.close()
            raise self._unreachable("it sends no pictures")
        self._stream = self._container.streams.video[0]
        # By slices: threads by frame add a delay of several pictures.
        self._stream.thread_type = "SLICE"
        if address.scheme in _IN_PARTS:
            # A key frame of several slices comes in several packets. Without this each is taken for a whole picture:
            # half of it is missing, and all that follow until the next key frame inherit that, not marked as damaged.
            self._stream.codec_context.flags2 |= Flags2.chunks

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def __iter__(self) -> Iterator[LivePicture]:
        """Yield pictures from the first key frame on, until the sender ends.

        Raises:
            StreamUnreachable: Nothing came for too long, or nothing that can be decoded.
        """
        return self._paced() if self._address.scheme == "replay" else self._pictures()

    def _pictures(self) -> Iterator[LivePicture]:
        is_whole, failures = False, 0
        try:
            for packet in self._container.demux(self._stream):
                self._note_told(packet)
                # What comes before a key frame refers to pictures that nobody has.
                is_whole = is_whole or packet.is_keyframe
                if not is_whole:
                    continue
                try:
                    frames = packet.decode()
                except av.FFmpegError as error:
                    self.damaged += 1
                    failures += 1
                    is_whole = False
                    if failures >= _DAMAGED_IN_A_ROW:
                        raise self._unreachable(f"{failures} pictures in a row cannot be decoded: {error}") from None
                    continue
                for frame in frames:
                    failures = 0
                    if frame.pts is not None and frame.time_base is not None:
                        told = self._told.pop(int(frame.pts), None)
                        yield LivePicture(frame, float(frame.pts * frame.time_base), told)
        except (av.FFmpegError, OSError) as error:
            raise self._refusal(error) from None

    def _paced(self) -> Iterator[LivePicture]:
        """Yield a film's pictures at the film's own pace."""
        begun_s: float | None = None
        for picture in self._pictures():
            now_s = time.monotonic()
            begun_s = now_s - picture.stamp_s if begun_s is None else begun_s
            time.sleep(max(0.0, begun_s + picture.stamp_s - now_s))
            yield picture

    def _note_told(self, packet: av.Packet) -> None:
        """Keep the sender's time of a picture, which arrives with its packet (RTCP), until the picture is decoded."""
        if packet.pts is None:
            return
        for data in packet.iter_sidedata():
            if data.data_type == "prft":
                (wall_us,) = struct.unpack_from("<q", bytes(data))
                self._told[int(packet.pts)] = wall_us / 1e6
        while len(self._told) > _KEPT_TIMES:
            self._told.pop(next(iter(self._told)))

    def close(self) -> None:
        """End the connection."""
        with suppress(av.FFmpegError, OSError):
            self._container.close()

    def _refusal(self, error: Exception) -> SourceError:
        said = self._address.masked(getattr(error, "strerror", None) or str(error))
        kinds = (av.error.HTTPUnauthorizedError, av.error.HTTPForbiddenError, av.error.HTTPNotFoundError)
        if isinstance(error, kinds) or "Unauthorized" in said or "401" in said:
            return StreamRefused(
                expected=f"{self._address} to let us in",
                found=said,
                fix="correct the stream's name, `user` and `password`",
            )
        return self._unreachable(said)

    def _unreachable(self, said: str) -> StreamUnreachable:
        return StreamUnreachable(
            expected=f"pictures from {self._address}", found=said, fix="check that the sender is on and reachable"
        )


def _options(address: LiveAddress) -> dict[str, str]:
    options = {"protocol_whitelist": PROTOCOLS[address.scheme]}
    if address.scheme == "replay":
        return options
    options |= _QUICK
    if address.scheme in ("rtsp", "rtsps"):
        options["rtsp_transport"] = "tcp"
    if address.scheme in ("rtsps", "rtmps"):
        options["tls_verify"] = "1"
        if address.ca_file is not None:
            options["ca_file"] = str(address.ca_file)
    return options
