"""A server for one person on this machine: it begins with a page, and ends with it."""

from __future__ import annotations

import asyncio
import secrets
import socket
import webbrowser
from collections.abc import AsyncIterator, Callable
from typing import Final

import uvicorn
from starlette.types import ASGIApp

from standoff.core.errors import ConfigError
from standoff.service.access import Access

HOST: Final = "127.0.0.1"
_LEFT_S: Final = 5.0
"""A page that is loaded again is away for less than this."""
_BEAT_S: Final = 1.0
_LOOK_S: Final = 0.25


class OpenPages:
    """Counts the pages that are open, and tells each what has changed.

    Attributes:
        version: Rises with every change that open pages should know of.
    """

    def __init__(self) -> None:
        self.version = 0
        self.count = 0
        self._was_open = False
        self._left_s = 0.0

    async def events(self) -> AsyncIterator[str]:
        """Yield server-sent events for one page, for as long as it listens: each change, and a beat every second."""
        self.count += 1
        self._was_open = True
        told = -1
        waited_s = 0.0
        try:
            while True:
                if self.version != told:
                    told = self.version
                    yield f"event: version\ndata: {told}\n\n"
                elif waited_s >= _BEAT_S:
                    waited_s = 0.0
                    yield ": beat\n\n"
                await asyncio.sleep(_LOOK_S)
                waited_s += _LOOK_S
        finally:
            self.count -= 1

    async def all_left(self) -> None:
        """Return when a page had been open and for some seconds none has been."""
        while self._left_s < _LEFT_S:
            await asyncio.sleep(_LOOK_S)
            self._left_s = self._left_s + _LOOK_S if self._was_open and not self.count else 0.0


def serve_page(
    app: ASGIApp, pages: OpenPages, port: int, tell: Callable[[str], None], *, opens_browser: bool = True
) -> None:
    """Serve a page on this machine until it is closed, or Ctrl-C.

    Args:
        app: Answers.
        pages: Which it counts.
        port: On which; 0: any that is free.
        tell: Called with the address, once it answers.
        opens_browser: Show it there, too.

    Raises:
        ConfigError: The port is taken.
    """
    listening = listen(port)
    token = secrets.token_urlsafe(24)
    address = f"http://{HOST}:{listening.getsockname()[1]}/?token={token}"
    config = uvicorn.Config(
        Access(app, token), log_level="error", access_log=False, lifespan="off", timeout_graceful_shutdown=2
    )
    server = uvicorn.Server(config)

    async def serve() -> None:
        serving = asyncio.create_task(server.serve(sockets=[listening]))
        leaving = asyncio.create_task(pages.all_left())
        while not server.started and not serving.done():
            await asyncio.sleep(0.02)
        tell(address)
        if opens_browser:
            webbrowser.open(address)
        await asyncio.wait({serving, leaving}, return_when=asyncio.FIRST_COMPLETED)
        server.should_exit = True
        leaving.cancel()
        await serving

    try:
        asyncio.run(serve())
    except KeyboardInterrupt:
        pass
    finally:
        listening.close()


def listen(port: int) -> socket.socket:
    """Return a socket that listens on this machine alone."""
    listening = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    # A port that a page just left can be used again; one on which somebody listens cannot.
    listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listening.bind((HOST, port))
        listening.listen()
    except OSError as error:
        listening.close()
        raise ConfigError(
            expected=f"a free port {port}",
            found=error.strerror or str(error),
            fix="choose another --port, or 0 for any",
        ) from error
    return listening
