"""Video files through PyAV: presentation timestamps, upright square pixels, an exact start, and an honest end."""

from __future__ import annotations

import math
from collections.abc import Iterator
from fractions import Fraction
from itertools import chain, dropwhile, islice
from pathlib import Path
from typing import Any

import av

from standoff.core.camera import CameraPrior
from standoff.core.errors import SourceError, SourceTruncated
from standoff.files.fingerprint import fingerprint
from standoff.files.orientation import Orientation
from standoff.stages.frames.container import Header, describe_streams, not_a_video, open_video, passed_over
from standoff.stages.frames.display_orientation import display_orientation
from standoff.stages.frames.pictures import AvPicture, Scaler
from standoff.stages.frames.pixel_shape import square_size_px
from standoff.stages.frames.prior import drone_prior, find_drone
from standoff.stages.frames.reader import TIME_ROUNDING_S, Selection, Shot, check_size
from standoff.stages.frames.times import AviTicks, RisingTimes

_UNDECODABLE_IN_A_ROW = 100
_OPENING = 3
"""Frames tell together whether the first one's time is wrong."""


class VideoReader:
    """Read a video file.

    Times are presentation timestamps from the first picture on, so variable frame rate is normal. Packets
    that cannot be decoded are skipped, concealed pictures are kept; both are counted in `corrupt_frames`. Pictures
    are turned and mirrored as the film's display matrix says, and stretched sideways where its pixels are not square.

    Args:
        path: The file.
        fps: None: the file's own timestamps. Otherwise they are replaced by index / fps.

    Attributes:
        corrupt_frames: Pictures lost or damaged so far.

    Raises:
        SourceError: It is no video, its pixels or its display matrix have a shape that films do not have, or not one
            picture of it can be decoded.
        SourceTruncated: The table of its frames is missing.
    """

    def __init__(self, path: Path, fps: float | None) -> None:
        self._path, self._fps = path, fps
        self._scaler = Scaler()
        self.corrupt_frames = 0
        self._discarded = 0  # by an edit list
        self._container, self._stream = open_video(path)
        self._header = header = Header.of(self._container, self._stream)
        self.started_at = header.created_at
        self.total_frames = header.total_frames
        self.rate_fps = header.rate_fps if fps is None else fps
        self._frames = self._decoded()
        try:
            self._opening = self._opening_frames()
            self._first, self._origin_pts = self._opening[0], self._begins_at()
            self.orientation = self._orientation()
            picture = self._picture(self._first)
        except SourceError:
            self._container.close()
            raise
        self.size_px = (picture.width_px, picture.height_px)
        self.drone = find_drone(header.camera_names)
        self.camera_prior = (
            CameraPrior.unknown(*self.size_px)
            if self.drone is None
            else drone_prior(self.size_px, self.drone, film=True)
        )
        self._times = RisingTimes(path.name)
        self._layout = self._what_was_chosen()
        self._about = self._describe()  # now: at the end the file may be gone

    def _opening_frames(self) -> list[av.VideoFrame]:
        """Read the first frames, which tell together when the film begins."""
        opening = list(islice(self._frames, _OPENING))
        if not opening:
            raise not_a_video(self._path, "not one picture of which can be decoded")
        return opening

    def _begins_at(self) -> int | None:
        """Return when the first frame is shown, or the second where the first one's time is wrong; None: unknown."""
        if any(frame.pts is None for frame in self._opening):
            return None if self._opening[0].pts is None else int(self._opening[0].pts)
        shown = [(float(frame.pts * self._header.time_base_s), "", int(frame.pts)) for frame in self._opening]
        return next(pts for _, pts in RisingTimes("").in_order(shown))

    def _orientation(self) -> Orientation:
        try:
            return display_orientation(self._first)
        except ValueError as error:
            raise SourceError(
                expected="a video turned by a multiple of 90 degrees",
                found=f"{self._path.name}, {error}",
                fix="convert it with ffmpeg, which turns the pictures",
            ) from error

    def _picture(self, frame: av.VideoFrame) -> AvPicture:
        try:
            return AvPicture(frame, self.orientation, self._scaler, self._header.pixel_aspect)
        except ValueError as error:
            raise SourceError(
                expected="pixels that are square, or nearly so",
                found=f"{error} in {self._path.name}",
                fix="correct it with ffmpeg (-aspect, or the filter setsar)",
            ) from error

    def _decoded(self) -> Iterator[av.VideoFrame]:
        """Yield the frames from where the container stands; remember why reading stopped, if it failed."""
        self._reading_error = ""
        self.corrupt_frames = failures = 0
        avi_ticks = AviTicks()
        try:
            for packet in self._container.demux(self._stream):
                self._discarded += packet.is_discard
                try:
                    frames = packet.decode()
                except av.FFmpegError as error:
                    failures += 1
                    self.corrupt_frames += 1
                    if failures >= _UNDECODABLE_IN_A_ROW:
                        self._reading_error = f"{failures} packets in a row that cannot be decoded: {error}"
                        return
                    continue
                for frame in frames:
                    failures = 0
                    self.corrupt_frames += frame.is_corrupt
                    if self._header.tells_decoding_times_only:
                        frame.pts = avi_ticks.of(frame.dts)
                    yield frame
        except av.FFmpegError as error:
            self._reading_error = str(error)

    def shots(self, wanted: Selection) -> Iterator[Shot]:
        """Yield the pictures that are wanted.

        A picture whose time is not later than the one before, or by microseconds only, is skipped and counted.

        Raises:
            FrameSizeChanged: At the first picture of another size.
            SourceTruncated: After the last picture, when the file declares more.
            SourceError: A timestamp is missing, or they increase no more.
        """
        first_index: int | None = None
        self._last_index, latest = -1, self._first
        timed = self._timed(wanted.start_s)
        given_rate = ((time_s, one) for time_s, _, one in timed)
        for time_s, (index, latest) in self._times.in_order(timed) if self._fps is None else given_rate:
            if time_s < wanted.start_s - TIME_ROUNDING_S:
                continue
            first_index = index if first_index is None else first_index
            if (index - first_index) % wanted.every == 0:
                yield Shot(index, time_s, self._picture(latest), f"frame {index}")
        self._check_end(latest)

    def _timed(self, start_s: float) -> Iterator[tuple[float, str, tuple[int, av.VideoFrame]]]:
        """Yield frames with their times and labels, in the order of the file, and keep the last one's index."""
        for index, frame in self._numbered_from(start_s):
            self._last_index = index
            check_size(self._picture(frame), self.size_px, f"frame {index}")
            yield self._time_s(index, frame), f"frame {index}", (index, frame)

    def _numbered_from(self, start_s: float) -> Iterator[tuple[int, av.VideoFrame]]:
        """Yield all frames with their index, from the start or, where that is exact, from just before `start_s`."""
        if start_s > 0 and self._fps is None:
            jumped = self._jumped_to(start_s)
            if jumped is not None:
                return jumped
        return enumerate(chain(self._opening, self._frames))

    def _time_s(self, index: int, frame: av.VideoFrame) -> float:
        if self._fps is not None:
            return index / self._fps
        if frame.pts is None or self._origin_pts is None:
            raise SourceError(
                expected="a timestamp on every frame",
                found=f"none on frame {index} of {self._path.name}",
                fix="rewrap the file with ffmpeg, or give its frame rate (--fps)",
            )
        return float((frame.pts - self._origin_pts) * self._header.time_base_s)

    def _jumped_to(self, start_s: float) -> Iterator[tuple[int, av.VideoFrame]] | None:
        """Seek to the key frame before `start_s` and number from there; None, at the start, if that is unsure.

        A frame's index is the number of packets shown before it, counted without decoding them.
        """
        first = self._first
        if first.pts is None or first.pts != self._origin_pts or self._header.tells_decoding_times_only:
            return None
        if first.interlaced_frame:  # its two fields may come as two packets
            return None
        start_pts = first.pts + math.ceil(Fraction(start_s - TIME_ROUNDING_S) / self._header.time_base_s)
        counted = self._count_packets(start_pts)
        if counted is None:
            return None
        first_index, key_frame_dts = counted
        self._container.seek(key_frame_dts, stream=self._stream)
        frames = self._decoded()
        landed = next(frames, None)
        if landed is not None and landed.key_frame and landed.pts is not None and landed.pts <= start_pts:
            shown = dropwhile(lambda frame: frame.pts is not None and frame.pts < start_pts, chain([landed], frames))
            first_shown = next(shown, None)
            if first_shown is not None:
                return enumerate(chain([first_shown], shown), start=first_index)
        self._container.close()
        self._container, self._stream = open_video(self._path)
        self._frames, self._opening = self._decoded(), []
        return None

    def _count_packets(self, start_pts: int) -> tuple[int, int] | None:
        """Return how many pictures are shown before `start_pts`, and the decoding time of the last key frame there.

        None where packets do not tell when they are shown.
        """
        count, key_frame_dts = 0, None
        container, stream = open_video(self._path)
        try:
            for packet in container.demux(stream):
                if not packet.size:
                    continue
                if packet.pts is None:
                    return None
                decoded_at = packet.pts if packet.dts is None else packet.dts  # Matroska's first packets have none
                if packet.dts is not None and decoded_at >= start_pts:  # whatever follows is shown even later
                    break
                if self._first.pts <= packet.pts < start_pts and not packet.is_discard:
                    count += 1
                    key_frame_dts = decoded_at if packet.is_keyframe else key_frame_dts
        except av.FFmpegError:
            return None
        finally:
            container.close()
        return None if key_frame_dts is None else (count, key_frame_dts)

    def _check_end(self, frame: av.VideoFrame) -> None:
        """Raise when the clock began anew, reading failed, or `frame` is not where the header lets the video end."""
        self._times.check_end()
        declared, end_s = self._header, 0.0
        if frame.pts is not None and self._origin_pts is not None:
            end_s = float((frame.pts - self._origin_pts + (frame.duration or 0)) * declared.time_base_s)
        if not self._reading_error and not declared.ends_early(self._last_index + 1 + self._discarded, end_s):
            return
        promised = f"{declared.declared_frames} frames" if declared.declared_frames else f"{declared.duration_s} s"
        reason = f" ({self._reading_error})" if self._reading_error else ""
        raise SourceTruncated(
            expected=f"{promised} in {self._path.name}, as its header says",
            found=f"the end after {self._last_index + 1} frames and {end_s:.2f} s{reason}",
            fix="copy the file again; what was read up to there is sound",
        )

    @property
    def warnings(self) -> tuple[str, ...]:
        """What is odd about the file, and what was lost of it so far."""
        found = [*self._layout, *self._times.warnings]
        if self.corrupt_frames:
            found.append(f"{self._path.name}: {self.corrupt_frames} pictures damaged or lost")
        return tuple(found)

    def _what_was_chosen(self) -> list[str]:
        """Return what was done to the file's pictures that not every program would do."""
        name, found = self._path.name, []
        if others := passed_over(self._container, self._stream):
            found.append(f"{name}: of its films stream {self._stream.index} is read, not {others}")
        if self.orientation.is_mirrored:
            found.append(f"{name}: its pictures are mirrored, as its display matrix says")
        pixel_aspect = self._header.pixel_aspect
        if pixel_aspect not in (None, 1):
            stored = f"{self._first.width}x{self._first.height}"
            square = "x".join(map(str, square_size_px((self._first.width, self._first.height), pixel_aspect)))
            found.append(f"{name}: its pixels are not square; {stored} are stretched to {square}")
        return found

    def describe(self) -> dict[str, Any]:
        """Return what it is, for the record; `corrupt_frames` and `skipped_frames` as counted so far.

        `size_px` is of the pictures as they are given, upright and with square pixels.
        """
        return self._about | {"corrupt_frames": self.corrupt_frames, "skipped_frames": self._times.skipped}

    def _describe(self) -> dict[str, Any]:
        return {
            "name": self._path.name,
            "kind": "video",
            "container": self._header.container,
            "codec": self._header.codec,
            "pixel_format": self._first.format.name,
            "size_px": list(self.size_px),
            "stored_size_px": [self._first.width, self._first.height],
            "pixel_aspect": str(self._header.pixel_aspect or 1),
            **self.orientation.describe(),
            "stream": self._stream.index,
            "streams": describe_streams(self._container),
            "fps": self.rate_fps,
            "duration_s": self._header.duration_s,
            "fingerprint": fingerprint([self._path]),
            "frames_declared": self._header.declared_frames or None,
            "clock": "presentation timestamps" if self._fps is None else "given frame rate",
        }

    def close(self) -> None:
        """Close the file; pictures already yielded stay valid."""
        self._container.close()
