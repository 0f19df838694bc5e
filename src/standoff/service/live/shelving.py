"""Alarms that are set aside for a while, by whom and why."""

from __future__ import annotations

import time
from pathlib import Path

from ulid import ULID

from standoff.config import SiteSettings, build_zones
from standoff.core.errors import ConfigError
from standoff.files.whole import make_folder
from standoff.service.live.outbox import Outbox, Shelf


def set_aside(
    site: SiteSettings,
    author: str,
    reason: str,
    duration_s: float,
    *,
    stream: str = "",
    zone: str = "",
    hazard_id: str = "",
) -> Shelf:
    """Set alarms aside; a service that runs takes notice at once.

    Args:
        site: The settings.
        author: Who answers for it.
        reason: Why.
        duration_s: For how long.
        stream: Of this stream only.
        zone: Of this zone only.
        hazard_id: This hazard only.

    Raises:
        ConfigError: Nobody answers for it, all alarms of the site are meant, or there is no such stream or zone.
    """
    if not author.strip() or not reason.strip():
        raise ConfigError(expected="an author and a reason", found="none", fix="say who sets it aside, and why")
    if not (stream or zone or hazard_id):
        raise ConfigError(
            expected="a stream, a zone or a hazard", found="none", fix="name one: a whole site is not set aside"
        )
    zones = {one.name for each in site.streams.values() for one in build_zones(each.settings)}
    for what, asked, known in (("stream", stream, set(site.streams)), ("zone", zone, zones)):
        if asked and asked not in known:
            there = ", ".join(sorted(known)) or "none"
            raise ConfigError(expected=f"a {what} of the site", found=asked, fix=f"there are: {there}")
    shelf = Shelf(str(ULID()), stream, zone, hazard_id, author.strip(), reason.strip(), time.time() + duration_s)
    outbox = _outbox(site.live.state)
    outbox.shelve(shelf)
    outbox.close()
    return shelf


def take_back_shelf(state: Path, shelf_id: str) -> None:
    """Take back that alarms are set aside.

    Raises:
        ConfigError: Nothing of that id is.
    """
    outbox = _outbox(state)
    found = outbox.unshelve(shelf_id)
    outbox.close()
    if not found:
        raise ConfigError(expected="the id of something set aside", found=shelf_id, fix="see the status page")


def _outbox(state: Path) -> Outbox:
    make_folder(state)
    return Outbox(state)
