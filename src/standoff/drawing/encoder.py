"""An MP4 file that can be played whenever the process dies: H.264 in fragments."""

from __future__ import annotations

import errno
from contextlib import suppress
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import cv2
from av.video.codeccontext import VideoCodecContext
from av.video.reformatter import ColorRange, Colorspace, VideoReformatter

from standoff.core.errors import MissingDependency
from standoff.core.types import ImageArray
from standoff.files.whole import partial_file

_TIME_BASE = Fraction(1, 60_000)  # frames of 23.976 to 60 Hz last whole ticks; MPEG-4 Part 2 takes at most 65535
_KEYFRAME_EVERY_S = 2.0
_ENCODERS = ("libx264", "libopenh264", "mpeg4")
_NOMINAL_FPS = 30
_BT709 = 1  # of primaries and transfer, in libav's numbering


class VideoFile:
    """Write pictures with their times.

    While it grows the file consists of fragments of two seconds, each readable as soon as it is written.
    `close` rewrites it, without encoding again, as a plain MP4 with its index at the front, which every
    player can seek in; the name points to a readable file at any time.

    Args:
        path: The file.
        size_px: (width, height), both even.
        crf: x264's rate factor; other encoders get a bit rate of similar quality.
        preset: x264's preset.
        bit_rate_bps: Mean bits a second as cameras have it, in place of `crf`.
        bt709: Colours as high-definition cameras code them, and marked so; otherwise BT.601, which is quicker.

    Raises:
        MissingDependency: This build of PyAV has no encoder for MP4.
    """

    def __init__(
        self, path: Path, size_px: tuple[int, int], *, preset: str, crf: int = 23, bit_rate_bps: int | None = None,
        bt709: bool = False,
    ) -> None:  # fmt: skip
        self._path = path
        self._reformatter = VideoReformatter() if bt709 else None
        encoder = available_encoder()
        options = {"movflags": "frag_keyframe+empty_moov+default_base_moof", "flush_packets": "1"}
        self._container = av.open(str(path), "w", format="mp4", options=options)
        self._stream = self._container.add_stream(encoder, rate=_NOMINAL_FPS)
        self._stream.width, self._stream.height = size_px
        self._stream.pix_fmt = "yuv420p"
        self._stream.codec_context.time_base = _TIME_BASE
        # without B-frames each fragment holds all of its pictures, and presentation times need no shift
        self._stream.codec_context.max_b_frames = 0
        if bt709:
            _mark_bt709(self._stream.codec_context)
        if bit_rate_bps is not None:
            self._stream.bit_rate = bit_rate_bps
            peak = {"maxrate": str(bit_rate_bps * 3 // 2), "bufsize": str(bit_rate_bps)}
            self._stream.options = {"preset": preset, **peak} if encoder == "libx264" else peak
        elif encoder == "libx264":
            self._stream.options = {"crf": str(crf), "preset": preset}
        else:
            self._stream.bit_rate = int(size_px[0] * size_px[1] * _NOMINAL_FPS * 0.1)
        self._is_broken = False
        self._last_ticks = -1
        self._keyframe_ticks: int | None = None

    def write(self, picture: ImageArray, time_s: float) -> None:
        """Encode a picture.

        Args:
            picture: (height, width, 3) uint8 BGR of the file's size.
            time_s: When it is shown, from the start of the file; moved on by one tick where it does not increase.

        Raises:
            OSError: It cannot be written; nor can any later one.
        """
        ticks = max(round(time_s / _TIME_BASE), self._last_ticks + 1)
        frame = self._coded(picture)
        frame.pts, frame.time_base = ticks, _TIME_BASE
        frame.duration = ticks - self._last_ticks if self._last_ticks >= 0 else round(1 / _NOMINAL_FPS / _TIME_BASE)
        if self._keyframe_ticks is None or ticks - self._keyframe_ticks >= _KEYFRAME_EVERY_S / _TIME_BASE:
            frame.pict_type = av.video.frame.PictureType.I
            self._keyframe_ticks = ticks
        self._last_ticks = ticks
        self._mux(frame)

    def _mux(self, frame: av.VideoFrame | None) -> None:
        # After a header that found no room libav would write it once more, and dies of that.
        if self._is_broken:
            raise OSError(errno.EIO, "an earlier picture could not be written", str(self._path))
        self._is_broken = True
        self._container.mux(self._stream.encode(frame))
        self._is_broken = False

    def _coded(self, picture: ImageArray) -> av.VideoFrame:
        if self._reformatter is None:
            return av.VideoFrame.from_ndarray(cv2.cvtColor(picture, cv2.COLOR_BGR2YUV_I420), format="yuv420p")
        return self._reformatter.reformat(
            av.VideoFrame.from_ndarray(picture, format="bgr24"),
            format="yuv420p",
            dst_colorspace=Colorspace.ITU709,
            dst_color_range=ColorRange.MPEG,
            threads=cv2.getNumThreads(),
        )

    def close(self) -> None:
        """Finish the file; after a picture that could not be written, keep it as it is, if it can be played at all.

        Raises:
            OSError: It cannot be written, or not rewritten; then what was written so far stays.
        """
        if self._is_broken:
            self._leave()
            return
        try:
            self._mux(None)
            self._container.close()
        except BaseException:
            self._leave()
            raise
        with partial_file(self._path) as partial:
            _rewrite(self._path, partial)

    def _leave(self) -> None:
        with suppress(OSError):
            self._container.close()
        if not _can_be_played(self._path):
            with suppress(OSError):
                self._path.unlink(missing_ok=True)

    def discard(self) -> None:
        """Stop and remove the file."""
        with suppress(OSError):
            self._container.close()
        self._path.unlink(missing_ok=True)


def _mark_bt709(codec: VideoCodecContext) -> None:
    codec.colorspace = Colorspace.ITU709
    codec.color_range = ColorRange.MPEG
    codec.color_primaries = codec.color_trc = _BT709


def available_encoder() -> str:
    """Return the best MP4 video encoder that this build of PyAV has.

    Raises:
        MissingDependency: It has none.
    """
    for name in _ENCODERS:
        try:
            av.Codec(name, "w")
        except av.codec.codec.UnknownCodecError:
            continue
        return name
    raise MissingDependency(
        expected=f"one of the video encoders {', '.join(_ENCODERS)}",
        found="none of them in this build of PyAV",
        fix="install PyAV from its wheel (pip install --force-reinstall av) or switch the annotated video off",
    )


def _can_be_played(path: Path) -> bool:
    try:
        with av.open(str(path)) as container:
            return next(container.decode(video=0), None) is not None
    except (OSError, av.error.FFmpegError):
        return False


def _rewrite(fragmented: Path, whole: Path) -> None:
    with (
        av.open(str(fragmented)) as source,
        av.open(str(whole), "w", format="mp4", options={"movflags": "faststart"}) as target,
    ):
        stream: Any = source.streams.video[0]
        copied = target.add_stream_from_template(stream)
        for packet in source.demux(stream):
            if packet.dts is not None:
                packet.stream = copied
                target.mux(packet)
