"""Open a video file or say plainly why it cannot be; read what its header declares."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING

import av
from av.stream import Disposition

from standoff.core.errors import SourceError, SourceTruncated
from standoff.files.lfs import refuse_pointer

if TYPE_CHECKING:
    from av.container import InputContainer
    from av.video.stream import VideoStream

_TEXT_ART_CODECS = frozenset({"ansi", "bintext", "idf", "xbin"})  # how libav "decodes" a text file
_FRAMES_FORGIVEN = 2  # headers of sound files are off by this much


def open_video(path: Path) -> tuple[InputContainer, VideoStream]:
    """Return the container and its video stream, ready to decode on all cores.

    Raises:
        SourceError: It is no video file.
        SourceTruncated: The table of its frames is missing.
    """
    if path.stat().st_size == 0:
        raise SourceError(expected="a video file", found=f"{path.name}, which is empty", fix="copy it again")
    refuse_pointer(path, f"a video file in {path.name}", SourceError)
    try:
        # The prefix keeps names such as "cam:1.mp4" from being taken for a protocol.
        container = av.open(f"file:{path}", metadata_errors="replace")
    except (av.FFmpegError, OSError) as error:
        if isinstance(error, OSError):
            raise SourceError(
                expected="a readable file", found=f"{path.name}: {error.strerror}", fix="check its permissions"
            ) from error
        if _begins_like_mp4(path):
            raise SourceTruncated(
                expected="a whole MP4 or MOV file",
                found=f"{path.name} without its table of frames (moov): cut off, or still being recorded",
                fix="copy it again, or repair it from another recording of the same camera",
            ) from error
        raise not_a_video(path, "which no reader recognises") from error
    streams = [stream for stream in container.streams.video if not stream.disposition & Disposition.attached_pic]
    if not streams:
        kinds = ", ".join(sorted({stream.type for stream in container.streams})) or "nothing"
        container.close()
        raise not_a_video(path, f"which holds {kinds} and no video")
    stream = streams[0]
    if stream.codec_context is None or stream.codec_context.name in _TEXT_ART_CODECS:
        container.close()
        raise not_a_video(path, "which holds text" if stream.codec_context else "whose codec is unknown")
    stream.thread_type = "AUTO"
    return container, stream


def _begins_like_mp4(path: Path) -> bool:
    with path.open("rb") as file:
        return file.read(8)[4:] == b"ftyp"


def not_a_video(path: Path, found: str) -> SourceError:
    """Return the error for a file that is none, `found` being a relative clause."""
    return SourceError(
        expected="a video file", found=f"{path.name}, {found}", fix="give a video that ffmpeg can read, or convert it"
    )


@dataclass(frozen=True, slots=True)
class Header:
    """What a file declares about its video.

    Attributes:
        container: Format of the file.
        codec: Of the video.
        time_base_s: Seconds a tick of the timestamps.
        declared_frames: Number of pictures; 0 when it does not tell.
        duration_s: Of the video; None when the file speaks only of all streams together, or not at all.
        rate_fps: Average pictures a second; 0 when unknown.
        created_at: Aware UTC, or None. Some cameras write their local time here, as if it were UTC.
        camera_names: What may be the camera's model; drones write it under several keys.
    """

    container: str
    codec: str
    time_base_s: Fraction
    declared_frames: int
    duration_s: float | None
    rate_fps: float
    created_at: datetime | None
    camera_names: tuple[str, ...]

    @classmethod
    def of(cls, container: InputContainer, stream: VideoStream) -> Header:
        """Read it."""
        return cls(
            container=container.format.name,
            codec=stream.codec_context.name,
            time_base_s=Fraction(stream.time_base or 0),
            declared_frames=stream.frames,
            duration_s=_duration_s(container, stream),
            rate_fps=float(stream.average_rate or stream.guessed_rate or 0.0),
            created_at=_creation_time(container, stream),
            camera_names=(*container.metadata.values(), *stream.metadata.values()),
        )

    @property
    def total_frames(self) -> int | None:
        """Declared number of pictures, or what duration and average rate make of it; None without either."""
        if self.declared_frames:
            return self.declared_frames
        return round(self.duration_s * self.rate_fps) if self.duration_s and self.rate_fps else None

    @property
    def tells_decoding_times_only(self) -> bool:
        """AVI has no presentation timestamps; libav makes some up, wrong ones where pictures are reordered.

        The frame's decoding time differs from its presentation time by a constant, and is missing on the
        last few frames, one tick apart.
        """
        return self.container == "avi"

    def ends_early(self, frames: int, end_s: float) -> bool:
        """Tell whether a video that ends after this many frames and seconds is shorter than declared.

        It is when it is short by every measure that is declared. A count alone is no proof: some files
        count pictures that the camera left out.
        """
        period_s = 1.0 / self.rate_fps if self.rate_fps else 0.0
        declared_s = max(self.duration_s or 0.0, self.declared_frames * period_s)
        few = frames < self.declared_frames - _FRAMES_FORGIVEN
        short = end_s < declared_s - (_FRAMES_FORGIVEN + 0.5) * period_s
        return short and (few or not self.declared_frames)


def _duration_s(container: InputContainer, stream: VideoStream) -> float | None:
    if stream.duration is not None and stream.time_base is not None:
        return float(stream.duration * stream.time_base)
    # Matroska counts from 0 to the end, also where the first picture comes later.
    start_s = float((stream.start_time or 0) * (stream.time_base or 0)) if "matroska" in container.format.name else 0.0
    tag = stream.metadata.get("DURATION", "")  # Matroska's "00:01:02.345000000"
    if tag.count(":") == 2 and tag.replace(":", "").replace(".", "", 1).isdecimal():
        hours, minutes, seconds = tag.split(":")
        return int(hours) * 3600 + int(minutes) * 60 + float(seconds) - start_s
    if container.duration is not None and len(container.streams) == 1:
        return float(container.duration / av.time_base) - start_s
    return None


def _creation_time(container: InputContainer, stream: VideoStream) -> datetime | None:
    text = container.metadata.get("creation_time") or stream.metadata.get("creation_time")
    try:
        created = datetime.fromisoformat(text or "")
    except ValueError:
        return None
    return created.replace(tzinfo=UTC) if created.tzinfo is None else created.astimezone(UTC)
