"""A real browser on a real page: Debian's Chromium, driven by Playwright."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

PROJECT = Path(__file__).resolve().parents[2]
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
AXE = PROJECT / "page" / "node_modules" / "axe-core" / "axe.min.js"
BUILT = PROJECT / "src" / "standoff" / "service" / "page" / "assets"
SLOW_MS = 120_000


def told(figure: str) -> None:
    """Say a figure; `pytest -s` shows it."""
    sys.stdout.write(f"{figure}\n")


def needs_browser() -> None:
    """Skip where there is no browser or no page; CI has both."""
    missing = [
        name for name, there in (("chromium", CHROMIUM), ("the built pages: make page", BUILT.is_dir())) if not there
    ]
    if missing and os.environ.get("REQUIRE_BROWSER"):
        pytest.fail(f"this machine is to have {missing[0]}")
    if missing:
        pytest.skip(f"needs {missing[0]}")


@contextmanager
def served(*words: object) -> Generator[tuple[str, subprocess.Popen[str]], None, None]:
    """Start `standoff` with a page; give its address, and the process."""
    command = [sys.executable, "-u", "-m", "standoff", *map(str, words), "--no-browser"]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(str(PROJECT / part) for part in ("src", "tests"))}
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, env=environment)
    assert process.stdout is not None
    try:
        line = process.stdout.readline()
        found = re.search(r"http://\S+", line)
        assert found, line + process.stdout.read()
        yield found[0], process
    finally:
        process.kill()
        process.communicate()


class Browser:
    """One page in the browser; what it complains of is kept.

    Args:
        context: Of the browser.
    """

    def __init__(self, context: Any) -> None:
        self.page = context.new_page()
        self.page.set_default_timeout(SLOW_MS)
        self.complaints: list[str] = []
        self.page.on("console", self._heard)
        self.page.on("pageerror", lambda error: self.complaints.append(str(error)))

    def _heard(self, said: Any) -> None:
        if said.type in ("error", "warning"):
            self.complaints.append(said.text)

    def picture_click(self, selector: str, at_px: tuple[float, float], width_px: int) -> None:
        """Click a point of the film's picture."""
        box = self.page.locator(selector).bounding_box()
        scale = box["width"] / width_px
        self.page.mouse.click(box["x"] + (at_px[0] + 0.5) * scale, box["y"] + (at_px[1] + 0.5) * scale)

    def grave_findings(self) -> list[str]:
        """Return what axe calls serious or critical; () where all is well."""
        if not self.page.evaluate("() => typeof axe !== 'undefined'"):
            self.page.evaluate(AXE.read_text(encoding="utf-8"))
        found = self.page.evaluate("async () => (await axe.run()).violations")
        return [
            f"{one['id']}: {[node['html'][:120] for node in one['nodes']][:3]}"
            for one in found
            if one["impact"] in ("serious", "critical")
        ]


@contextmanager
def browsing(**look: Any) -> Generator[Browser, None, None]:
    """Give a browser with one page.

    Args:
        look: As Playwright's `new_context` has it: `locale`, `color_scheme`, `viewport`.
    """
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        # A container has no sandbox of its own to give.
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        try:
            yield Browser(browser.new_context(**{"viewport": {"width": 1500, "height": 1000}, **look}))
        finally:
            browser.close()
