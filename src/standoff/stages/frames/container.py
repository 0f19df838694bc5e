"""Open a video file or say plainly why it cannot be; read what its header declares."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any

import av
from av.stream import Disposition

from standoff.core.errors import SourceError, SourceTruncated
from standoff.files.lfs import refuse_pointer

if TYPE_CHECKING:
    from av.container import InputContainer
    from av.video.stream import VideoStream

_AVI = "avi"
_TEXT_ART_CODECS = frozenset({"ansi", "bintext", "idf", "xbin"})  # how libav "decodes" a text file
_NO_FILM = Disposition.attached_pic | Disposition.timed_thumbnails
_FRAMES_FORGIVEN = 2  # headers of sound files are off by this much


def open_video(path: Path) -> tuple[InputContainer, VideoStream]:
    """Return the container and the stream of its film, ready to decode on all cores.

    Thumbnails and attached pictures are no films; of several films it is the main one.

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
    films = [stream for stream in container.streams.video if not stream.disposition & _NO_FILM]
    if not films:
        kinds = ", ".join(sorted({stream.type for stream in container.streams})) or "nothing"
        container.close()
        raise not_a_video(path, f"which holds {kinds} and no video")
    stream = _main(films)
    if stream.codec_context is None or stream.codec_context.name in _TEXT_ART_CODECS:
        container.close()
        raise not_a_video(path, "which holds text" if stream.codec_context else "whose codec is unknown")
    stream.thread_type = "AUTO"
    return container, stream


def _main(films: Sequence[VideoStream]) -> VideoStream:
    """Return the film itself, of which a camera may have put a preview into the same file.

    As ffmpeg chooses: one that is marked as the default, else any; of those the one with the most pixels; of those
    the first.
    """
    decodable = [film for film in films if film.codec_context is not None] or films
    marked = [film for film in decodable if film.disposition & Disposition.default]
    return max(marked or decodable, key=_pixels)


def _pixels(film: VideoStream) -> int:
    return 0 if film.codec_context is None else film.codec_context.width * film.codec_context.height


def passed_over(container: InputContainer, chosen: VideoStream) -> str:
    """Name the films of a file that are not read; empty where there is no other."""
    others = [
        film for film in container.streams.video if film.index != chosen.index and not film.disposition & _NO_FILM
    ]
    sizes = [(film, film.codec_context) for film in others]
    return ", ".join(
        f"{film.index}" + (f" ({codec.width}x{codec.height})" if codec is not None else "") for film, codec in sizes
    )


def describe_streams(container: InputContainer) -> list[dict[str, Any]]:
    """Return what kinds of pictures a file holds, for the record."""
    return [
        {
            "index": film.index,
            "codec": None if film.codec_context is None else film.codec_context.name,
            "size_px": None if film.codec_context is None else [film.codec_context.width, film.codec_context.height],
            "disposition": [mark.name for mark in Disposition if film.disposition & mark],
        }
        for film in container.streams.video
    ]


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
        pixel_aspect: Width of a stored pixel in its heights; None: square, or not told.
        created_at: Aware UTC, or None. Some cameras write their local time here, as if it were UTC.
        camera_names: What may be the camera's model; drones write it under several keys.
    """

    container: str
    codec: str
    time_base_s: Fraction
    declared_frames: int
    duration_s: float | None
    rate_fps: float
    pixel_aspect: Fraction | None
    created_at: datetime | None
    camera_names: tuple[str, ...]

    @classmethod
    def of(cls, container: InputContainer, stream: VideoStream) -> Header:
        """Read it."""
        duration_s, declared = _duration_s(container, stream), stream.frames
        rate_fps = float(stream.average_rate or stream.guessed_rate or 0.0)
        if container.format.name == _AVI and (stored := _indexed_frames(stream)):
            # It declares ticks, of which those without a picture repeat the one before.
            declared, rate_fps = stored, stored / duration_s if duration_s else rate_fps
        return cls(
            container=container.format.name,
            codec=stream.codec_context.name,
            time_base_s=Fraction(stream.time_base or 0),
            declared_frames=declared,
            duration_s=duration_s,
            rate_fps=rate_fps,
            # Of the shape of a picture file's pixels no viewer takes notice.
            pixel_aspect=None if container.format.name.endswith("_pipe") else stream.sample_aspect_ratio,
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
        """AVI has no presentation timestamps; libav makes some up, wrong ones where pictures are reordered."""
        return self.container == _AVI

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


def _indexed_frames(stream: VideoStream) -> int:
    """Return how many pictures the file's index lists; 0 where it has none, or not to the end."""
    listed = list(stream.index_entries)
    is_whole = bool(listed) and listed[-1].timestamp + 1 + _FRAMES_FORGIVEN >= stream.frames
    return sum(entry.size > 0 for entry in listed) if is_whole else 0


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
