"""Read and detect one frame ahead, in a thread, while the stages after the detector work on the one before."""

from __future__ import annotations

import queue
import threading
from collections.abc import Generator, Iterator
from dataclasses import dataclass

from standoff.core.types import Frame
from standoff.monitor.monitor import Monitor, Seen, clocked

_LOOKS_FOR_THE_END_S = 0.1


@dataclass(frozen=True, slots=True)
class Ahead:
    """A frame that was read.

    Attributes:
        frame: The frame.
        read_ms: How long it was waited for, by stage.
        seen: What the detector saw in it; None: nobody has looked yet.
    """

    frame: Frame
    read_ms: dict[str, float]
    seen: Seen | None


def one_by_one(frames: Iterator[Frame]) -> Generator[Ahead, None, None]:
    """Read each frame when it is asked for."""
    while True:
        read_ms: dict[str, float] = {}
        with clocked(read_ms, "frames"):
            frame = next(frames, None)
        if frame is None:
            return
        yield Ahead(frame, read_ms, None)


def look_ahead(frames: Iterator[Frame], monitor: Monitor) -> Generator[Ahead, None, None]:
    """Read frames, and detect in those in which the detector runs anyway, while the caller works on the one before.

    The order is kept. What goes wrong in the thread is raised here, in its turn.

    Args:
        frames: Read by the thread only.
        monitor: Looks for the thread.
    """
    done: queue.Queue[Ahead | BaseException | None] = queue.Queue(maxsize=1)
    ended = threading.Event()

    def hand_over(news: Ahead | BaseException | None) -> None:
        while not ended.is_set():
            try:
                done.put(news, timeout=_LOOKS_FOR_THE_END_S)
                return
            except queue.Full:
                continue

    def work() -> None:
        try:
            for number, ahead in enumerate(one_by_one(frames)):
                if ended.is_set():
                    return
                looks = monitor.looks_at(number, ahead.frame)
                hand_over(Ahead(ahead.frame, ahead.read_ms, monitor.look(ahead.frame) if looks else None))
            hand_over(None)
        except BaseException as error:  # noqa: BLE001 - raised again where the frame would have come
            hand_over(error)

    thread = threading.Thread(target=work, name="look ahead", daemon=True)
    thread.start()
    try:
        while (news := done.get()) is not None:
            if isinstance(news, BaseException):
                raise news
            yield news
    finally:
        ended.set()
        thread.join()
