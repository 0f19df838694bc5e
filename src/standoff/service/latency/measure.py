"""Pictures of the clock against the clock."""

from __future__ import annotations

import asyncio
import threading
import time
from collections.abc import Callable
from datetime import UTC, datetime
from statistics import median
from typing import Final

import cv2
import numpy as np
from fastapi import FastAPI
from fastapi.responses import HTMLResponse, Response

from standoff.config import SiteSettings
from standoff.core.errors import ConfigError, SourceError
from standoff.core.types import ImageArray
from standoff.files.whole import make_folder
from standoff.service.answering import answering
from standoff.service.latency.clock_picture import clock_picture, read_clock
from standoff.service.live.delays import MeasuredDelay, keep_delay
from standoff.service.loopback import OpenPages, serve_page
from standoff.stages.frames import LiveAddress, LiveStream

_LARGEST_S: Final = 120.0
_EVERY_MS: Final = 100
_PAGE: Final = """<!doctype html><html lang="en"><meta charset="utf-8"><title>standoff: clock</title>
<link rel="stylesheet" href="/clock.css"><img id="clock" alt="the time of this machine, for the camera">
<script src="/clock.js"></script></html>"""
_CSS: Final = "body{margin:0;background:#fff;display:grid;place-items:center;height:100vh}img{height:96vh}"
_SCRIPT: Final = f"""const shown = document.getElementById("clock");
const again = () => {{ shown.src = "/clock.png?" + performance.now(); }};
shown.onload = () => setTimeout(again, {_EVERY_MS}); shown.onerror = () => setTimeout(again, 1000); again();
new EventSource("/api/events");"""


class DelayMeter:
    """Reads the clock in pictures of a stream, in a thread of its own.

    Args:
        address: Of the stream.
        wanted: How many pictures of the clock are enough.
        patience_s: Give up after so long.
    """

    def __init__(self, address: LiveAddress, wanted: int, patience_s: float) -> None:
        self._address, self._wanted, self._patience_s = address, wanted, patience_s
        self.delays_s: list[float] = []
        self.problem = ""
        self.ended = threading.Event()

    def run(self) -> None:
        """Look at pictures until it has seen enough, or patience is over."""
        until_s = time.monotonic() + self._patience_s
        last_shown_s = 0.0
        try:
            while not self.is_done and time.monotonic() < until_s and not self.ended.is_set():
                try:
                    last_shown_s = self._connection(until_s, last_shown_s)
                except SourceError as error:
                    self.problem = error.found
                    time.sleep(1.0)
        finally:
            self.ended.set()

    @property
    def is_done(self) -> bool:
        """Whether it has seen enough."""
        return len(self.delays_s) >= self._wanted

    def _connection(self, until_s: float, last_shown_s: float) -> float:
        with LiveStream(self._address) as stream:
            newest = _Newest(stream)
            try:
                while not self.is_done and time.monotonic() < until_s and not self.ended.is_set():
                    taken = newest.take()
                    if taken is None:
                        break
                    gray, arrived_unix_s = taken
                    shown_s = read_clock(gray)
                    # A clock that is seen again says only how long the screen has shown it.
                    if shown_s is not None and shown_s > last_shown_s and 0 <= arrived_unix_s - shown_s <= _LARGEST_S:
                        last_shown_s = shown_s
                        self.delays_s.append(arrived_unix_s - shown_s)
            finally:
                newest.end()
        return last_shown_s


class _Newest:
    """The newest picture of a stream: reading a clock takes longer than a picture, and would add to its delay."""

    def __init__(self, stream: LiveStream) -> None:
        self._stream = stream
        self._changed = threading.Condition()
        self._picture: tuple[ImageArray, float] | None = None
        self._is_over = self._is_ended = False
        self._thread = threading.Thread(target=self._read, daemon=True)
        self._thread.start()

    def _read(self) -> None:
        try:
            for picture in self._stream:
                with self._changed:
                    self._picture = (picture.frame.to_ndarray(format="gray"), time.time())
                    self._changed.notify_all()
                if self._is_ended:
                    return
        except SourceError:
            pass
        finally:
            with self._changed:
                self._is_over = True
                self._changed.notify_all()

    def end(self) -> None:
        """Read no more: a stream must not be closed while somebody reads it."""
        self._is_ended = True
        self._thread.join()

    def take(self) -> tuple[ImageArray, float] | None:
        with self._changed:
            self._changed.wait_for(lambda: self._picture is not None or self._is_over, 5.0)
            taken, self._picture = self._picture, None
            return taken


def measure_latency(
    site: SiteSettings,
    stream: str,
    pictures: int,
    patience_s: float,
    port: int,
    tell: Callable[[str], None],
    *,
    opens_browser: bool,
) -> MeasuredDelay:
    """Show a clock on a page, read it in the stream's pictures, and keep the delay for the service.

    Args:
        site: The settings.
        stream: Name of the stream, whose camera films the page.
        pictures: How many pictures of the clock are enough.
        patience_s: Give up after so long.
        port: Of the page; 0: any that is free.
        tell: Called with its address.
        opens_browser: Show it there, too.

    Raises:
        ConfigError: No such stream, the port is taken, or the clock was not seen often enough.
        OutputError: What was measured cannot be kept.
    """
    if stream not in site.streams:
        raise ConfigError(
            expected="a stream of the site", found=stream, fix=f"there are {', '.join(sorted(site.streams))}"
        )
    settings = site.streams[stream]
    meter = DelayMeter(settings.live_address, pictures, patience_s)
    threading.Thread(target=meter.run, daemon=True).start()
    pages = _Pages(meter.ended)
    serve_page(_clock_app(pages), pages, port, tell, opens_browser=opens_browser)
    meter.ended.set()
    if not meter.is_done:
        raise ConfigError(
            expected=f"{pictures} pictures of the clock within {patience_s:g} s",
            found=f"{len(meter.delays_s)}" + (f" ({meter.problem})" if meter.problem else ""),
            fix="let the camera see the whole code, sharp and large: a quarter of the picture's height",
        )
    delay_s, worst_s = median(meter.delays_s), max(meter.delays_s)
    at = datetime.now(UTC)
    make_folder(site.live.state)
    return keep_delay(
        site.live.state, stream, MeasuredDelay(delay_s, worst_s, len(meter.delays_s), settings.address, at.isoformat())
    )


class _Pages(OpenPages):
    """Ends the page as soon as the measurement has ended, whether or not somebody looks at it."""

    def __init__(self, ended: threading.Event) -> None:
        super().__init__()
        self._ended = ended

    async def all_left(self) -> None:
        while not self._ended.is_set():
            await asyncio.sleep(0.1)


def _clock_app(pages: OpenPages) -> FastAPI:
    app = answering("standoff: clock", pages)
    app.get("/", include_in_schema=False)(lambda: HTMLResponse(_PAGE))
    app.get("/clock.css", include_in_schema=False)(lambda: Response(_CSS, media_type="text/css"))
    app.get("/clock.js", include_in_schema=False)(lambda: Response(_SCRIPT, media_type="text/javascript"))
    app.get("/clock.png", include_in_schema=False)(_clock_png)
    return app


def _clock_png() -> Response:
    _, encoded = cv2.imencode(".png", clock_picture(time.time()))
    return Response(np.asarray(encoded).tobytes(), media_type="image/png")
