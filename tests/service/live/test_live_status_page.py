"""The status page as a safety manager has it on the wall: a real browser on a real service."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path
from typing import Any

import pytest
from service.browser import browsing, needs_browser, told
from service.live.scenes import NEAR_M, scene
from service.live.servers import until

pytestmark = pytest.mark.live
CARD = "status-page stream-card article"
LOOKS: tuple[dict[str, Any], ...] = (
    {"locale": "en", "color_scheme": "light"},
    {"locale": "de", "color_scheme": "dark", "viewport": {"width": 420, "height": 900}},
)


@pytest.fixture(autouse=True)
def _there_is_a_browser() -> None:
    needs_browser()


def test_the_page_shows_what_is_watched_what_is_not_and_when_nobody_answers(tmp_path: Path) -> None:
    with scene(tmp_path) as one, browsing() as browser:
        browser.page.goto(one.run.address())
        browser.page.wait_for_selector(CARD)
        until(lambda: "WATCHED" in browser.page.inner_text(CARD).upper(), what="a watched stream")
        assert "blind" not in (browser.page.get_attribute(CARD, "class") or "")
        browser.page.wait_for_selector("status-page stream-picture img, status-page stream-picture image")
        one.worker_m = NEAR_M
        browser.page.get_by_text("Distance 4.0", exact=False).wait_for()
        assert "DANGER" in browser.page.inner_text(CARD)
        one.sender.kill()
        killed_s = time.monotonic()
        until(lambda: "NOT WATCHED" in browser.page.inner_text(CARD).upper(), what="that it is not watched")
        told(f"the page says NOT WATCHED {time.monotonic() - killed_s:.1f} s after the sender was killed")
        assert "blind" in (browser.page.get_attribute(CARD, "class") or "")
        assert browser.complaints == []
        os.kill(until(lambda: one.run.pid("page")), signal.SIGSTOP)
        browser.page.get_by_text("No answer", exact=False).first.wait_for(timeout=10_000)
        assert browser.page.url.endswith("/"), "the secret is not left in the address"


@pytest.mark.parametrize("look", LOOKS)
def test_nothing_on_the_page_is_hard_to_read_or_to_reach(look: dict[str, Any], tmp_path: Path) -> None:
    with scene(tmp_path) as one, browsing(**look) as browser:
        one.worker_m = NEAR_M
        browser.page.goto(one.run.address())
        browser.page.wait_for_selector(CARD)
        time.sleep(3.0)
        assert browser.grave_findings() == []
        assert browser.complaints == []
        width_px = browser.page.viewport_size["width"]
        assert browser.page.evaluate("document.documentElement.scrollWidth") <= width_px
