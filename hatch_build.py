"""Builds the pages into the wheel, where there is Node; a wheel without them works, and says so."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

BUILT = "src/standoff/service/page"
LONGEST_S = 300
LEFT_OUT = "the pages of `standoff setup`, `open` and `serve` are left out"


class PagesHook(BuildHookInterface[Any]):
    """Runs before a wheel is made; an editable installation takes what `make page` has built."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Build the pages unless they are there, and put them into the wheel."""
        root = Path(self.root)
        pages = root / BUILT / "assets"
        if version != "editable" and not pages.is_dir():
            self._build(root / "page")
        if pages.is_dir():
            build_data["artifacts"].append(f"{BUILT}/**")

    def _build(self, page: Path) -> None:
        npm = shutil.which("npm")
        if npm is None or not (page / "package-lock.json").is_file():
            self.app.display_warning(f"{LEFT_OUT}: there is no Node here")
            return
        try:
            for words in (["ci", "--no-audit", "--no-fund"], ["run", "build"]):
                subprocess.run([npm, *words], cwd=page, check=True, capture_output=True, timeout=LONGEST_S)
        except (OSError, subprocess.SubprocessError) as error:
            self.app.display_warning(f"{LEFT_OUT}: {error}")
