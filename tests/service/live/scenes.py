"""A drawn site that is filmed, served, watched and told: all of it at once, as the live tests need it."""

from __future__ import annotations

import math
import os
import sys
from collections.abc import Callable, Generator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from service.live.drawn_site import DrawnSite
from service.live.feed import Camera
from service.live.running import Service, service, site_settings, with_work
from service.live.servers import RtspServer, Server, mosquitto, rtsp_server

from standoff.core.types import ImageArray

Place = tuple[float, float]
FAR_M: Place = (22.0, 6.0)
NEAR_M: Place = (4.0, 0.0)
MACHINE_M: Place = (0.0, 0.0)
_DRIVEN_M, _DRIVEN_S = 2.0, 10.0


def told(figure: str) -> None:
    """Say a figure; `pytest -s` shows it, and the file that FIGURES names keeps it."""
    sys.stdout.write(f"{figure}\n")
    if os.environ.get("FIGURES"):
        with Path(os.environ["FIGURES"]).open("a", encoding="utf-8") as file:
            file.write(f"{figure}\n")


@dataclass
class Scene:
    """A site that is watched.

    Attributes:
        drawn: What there is to see.
        camera: Films it.
        sender: Sends the film.
        broker: Passes messages on.
        run: The service.
        worker_m: Where the worker is; None: nowhere. Tests let him walk.
        machine_m: Where the machine is.
        drives: Whether the machine goes to and fro: one that has stood for a minute counts as parked.
    """

    drawn: DrawnSite
    camera: Camera
    sender: RtspServer
    broker: Server
    run: Service
    worker_m: Place | None = FAR_M
    machine_m: Place = MACHINE_M
    drives: bool = False

    def picture(self, time_s: float) -> ImageArray:
        """Return what the camera sees at a moment."""
        x_m, y_m = self.machine_m
        machine_m = (x_m, y_m + _DRIVEN_M * math.sin(2.0 * math.pi * time_s / _DRIVEN_S)) if self.drives else (x_m, y_m)
        return self.drawn.picture(self.worker_m, machine_m)


@contextmanager
def scene(
    folder: Path,
    size_px: tuple[int, int] = (640, 360),
    work_ms: float = 0.0,
    change: Callable[[dict[str, Any]], None] = lambda _: None,
) -> Generator[Scene, None, None]:
    """Film, serve and watch a drawn site.

    Args:
        folder: For all files.
        size_px: Of the pictures.
        work_ms: How long the detector works at each.
        change: Changes the settings before the service begins.
    """
    drawn = DrawnSite(size_px)
    made: list[Scene] = []

    def draw(time_s: float) -> ImageArray:
        return made[0].picture(time_s) if made else drawn.picture(FAR_M, MACHINE_M)

    with (
        mosquitto(folder) as broker,
        rtsp_server(folder) as sender,
        Camera(draw, sender.write, size_px=size_px) as camera,
    ):
        settings = with_work(
            site_settings(drawn.write_survey(folder / "survey.yaml"), broker.port, sender.address), work_ms
        )
        change(settings)
        with service(folder, settings) as run:
            made.append(Scene(drawn, camera, sender, broker, run))
            run.until_live()
            yield made[0]
