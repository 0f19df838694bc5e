"""The contract between page and server, as a file: `python -m standoff.service.contract > page/openapi.json`."""

from __future__ import annotations

import json
import sys

from standoff.service.setup.app import SetupPage, setup_app

if __name__ == "__main__":
    # The questions alone are asked for; nobody answers.
    json.dump(setup_app(object.__new__(SetupPage), None).openapi(), sys.stdout, indent=1, sort_keys=True)
    sys.stdout.write("\n")
