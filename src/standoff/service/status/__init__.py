"""The status page of a live site: read only, on this machine only."""

from __future__ import annotations

import os
import secrets
import time
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Final

import uvicorn

from standoff.core.errors import ConfigError, MissingDependency
from standoff.service.access import Access
from standoff.service.live.log import log_of
from standoff.service.live.shared import SharedRecord
from standoff.service.live.workplace import Workplace
from standoff.service.loopback import HOST, listen
from standoff.service.page_files import page_folder
from standoff.service.status.app import OPEN_PATHS, status_app
from standoff.service.status.overview import Overview

__all__ = ["Overview", "run", "status_app"]

_TOKEN_FILE: Final = "page-token"
_BEAT_S: Final = 0.5


def run(workplace: Workplace) -> None:
    """Serve the page of a site until the process that started this one is gone."""
    site = workplace.plan()
    token = _token(site.live.state)
    try:
        listening = listen(site.live.page.port)
    except ConfigError as error:
        # Somebody else's port must not end the watch: any other will do.
        log_of("page").error("any free port instead", reason=str(error))
        listening = listen(0)
    try:
        pages: Path | None = page_folder()
    except MissingDependency as error:
        log_of("page").warning("no page; /api/status, /healthz and /metrics answer", reason=str(error))
        pages = None
    address = f"http://{HOST}:{listening.getsockname()[1]}/?token={token}"
    guarded = Access(status_app(Overview(workplace), pages), token, opens_once=False, open_paths=OPEN_PATHS)
    config = uvicorn.Config(guarded, log_level="error", access_log=False, lifespan="off", timeout_graceful_shutdown=1)
    server = uvicorn.Server(config)
    workplace.repeat(partial(_beat, workplace.record("page"), address), _BEAT_S)
    server.run(sockets=[listening])


def _beat(record: SharedRecord, address: str) -> None:
    with suppress(ValueError):
        record.write({"beat_s": time.monotonic(), "pid": os.getpid(), "address": address})


def _token(state: Path) -> str:
    """Return the secret of the page's address: the same after a restart, readable by this user only."""
    path = state / _TOKEN_FILE
    with suppress(OSError, UnicodeDecodeError):
        kept = path.read_text(encoding="ascii").strip()
        if len(kept) >= 32:
            return kept
    token = secrets.token_urlsafe(32)
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600)
    os.fchmod(descriptor, 0o600)
    with os.fdopen(descriptor, "w", encoding="ascii") as file:
        file.write(token)
    return token
