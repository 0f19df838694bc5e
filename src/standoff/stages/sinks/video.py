"""`annotated.mp4`: the camera's picture with what was measured, and the ground from above beside it."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from standoff.core.lengths import UNITS
from standoff.core.types import FrameResult, ImageArray, Outcome
from standoff.core.zones import Zone
from standoff.drawing.encoder import VideoFile
from standoff.drawing.text import TextSprites
from standoff.stages.sinks.birdseye import BirdsEye
from standoff.stages.sinks.blurring import PeopleWatch, blur
from standoff.stages.sinks.frame_measurements import FrameMeasurements
from standoff.stages.sinks.overlay import Overlay
from standoff.stages.sinks.params import ShowParams, VideoParams
from standoff.stages.sinks.sketch import Sketch


class Composer:
    """Draw a frame and its panel side by side.

    Args:
        size_px: (width, height) of the camera's full-size pictures.
        params: Sizes and what is drawn.
        show: For the unit of lengths.
    """

    def __init__(
        self, size_px: tuple[int, int], params: VideoParams | None = None, show: ShowParams | None = None
    ) -> None:
        params = params or VideoParams()
        self._unit = UNITS[(show or ShowParams()).unit]
        text = TextSprites()
        self._draw = params.draw
        self._picture_size_px, panel_width_px = _layout(size_px, params)
        width, height = self._picture_size_px
        self._canvas: ImageArray = np.zeros((height, width + panel_width_px, 3), dtype=np.uint8)
        self._overlay = Overlay(params.draw, text)
        self._birdseye = BirdsEye((panel_width_px, height), params.draw, text) if panel_width_px else None

    @property
    def size_px(self) -> tuple[int, int]:
        """(width, height) of the composed picture; even numbers."""
        return self._canvas.shape[1], self._canvas.shape[0]

    def compose(self, picture: ImageArray, measurements: FrameMeasurements) -> ImageArray:
        """Draw one frame.

        Args:
            picture: (H, W, 3) uint8 BGR at `picture_size_px`.
            measurements: What was measured.

        Returns:
            (height, width, 3) uint8 BGR; the same array each time.
        """
        width = self._picture_size_px[0]
        sketch = Sketch.of(measurements, self._draw, self._unit)
        shown = self._canvas[:, :width]
        shown[:] = picture
        blur(shown, measurements.hidden_px, np.array([0.0, 0.0, *measurements.size_px]))
        if self._birdseye is not None:
            self._birdseye.draw(self._canvas[:, width:], shown, sketch)
        self._overlay.draw(shown, sketch)
        return self._canvas

    @property
    def picture_size_px(self) -> tuple[int, int]:
        """(width, height) that `compose` wants the camera's picture in."""
        return self._picture_size_px


class VideoSink:
    """Write the annotated video; its first frame is at time 0, and frames keep their distance in time.

    Args:
        path: The file, usually `annotated.mp4`.
        params: Sizes, quality and what is drawn.
        zones: Of the site.
        show: The unit of lengths, and whether people are made unrecognisable.
    """

    def __init__(
        self,
        path: Path | str,
        params: VideoParams | None = None,
        zones: tuple[Zone, ...] = (),
        show: ShowParams | None = None,
    ) -> None:
        self._path, self._params, self._zones = Path(path), params or VideoParams(), zones
        self._show = show or ShowParams()
        self._people = PeopleWatch(wanted=self._show.blur)
        self._composer: Composer | None = None
        self._file: VideoFile | None = None
        self._start_s = 0.0

    def write(self, result: FrameResult) -> None:
        """Draw and encode this frame."""
        frame = result.frame
        if self._composer is None or self._file is None:
            self._composer = Composer(frame.size_px, self._params, self._show)
            self._file = VideoFile(self._path, self._composer.size_px, crf=self._params.crf, preset=self._params.preset)
            self._start_s = frame.time_s
        size_px = self._composer.picture_size_px
        picture = frame.image if size_px == frame.size_px else frame.picture.resized_bgr(*size_px)
        measurements = FrameMeasurements.of(result, self._zones, self._people.update(result))
        composed = self._composer.compose(picture, measurements)
        self._file.write(composed, frame.time_s - self._start_s)

    def close(self, outcome: Outcome) -> None:
        """Finish the file; a run without a frame leaves none."""
        if self._file is not None:
            self._file.close()


def _layout(size_px: tuple[int, int], params: VideoParams) -> tuple[tuple[int, int], int]:
    """Return the picture's size and the panel's width; even numbers, as 4:2:0 video needs them."""
    aspect = size_px[0] / size_px[1]
    total_aspect = aspect + (params.panel_aspect if params.panel else 0.0)
    height = 2 * round(min(size_px[1], params.max_width_px / total_aspect) / 2)
    panel = 2 * round(height * params.panel_aspect / 2) if params.panel else 0
    return (2 * round(height * aspect / 2), height), panel
