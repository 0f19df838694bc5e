"""The contracts between pages and server, as files: `python -m standoff.service.contract page`."""

from __future__ import annotations

import sys
from pathlib import Path

from standoff.files.json_text import write_json
from standoff.service.loopback import OpenPages
from standoff.service.review.app import ReviewPage, review_app
from standoff.service.setup.app import SetupPage, setup_app
from standoff.service.status.app import status_app
from standoff.service.status.overview import Overview

if __name__ == "__main__":
    # The questions alone are asked for; nobody answers.
    contracts = {
        "setup": setup_app(object.__new__(SetupPage), OpenPages(), None),
        "review": review_app(object.__new__(ReviewPage), OpenPages(), None),
        "status": status_app(object.__new__(Overview), None),
    }
    for name, app in contracts.items():
        write_json(Path(sys.argv[1]) / f"{name}-api.json", app.openapi())
