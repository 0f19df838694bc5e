"""A process of the service, for the supervisor: `python -m standoff.service.live.child PROCESS WORKPLACE [STREAM]`.

With `--spare` behind it, it loads what it needs, and begins when a line comes: so it takes the place of one that died
without a delay.
"""

from __future__ import annotations

import sys
from importlib import import_module
from pathlib import Path
from typing import Final

from standoff.service.live.log import begin_log, log_of
from standoff.service.live.workplace import Workplace

SPARE: Final = "--spare"
_MODULES: Final = {
    "capture": "standoff.service.live.capture",
    "analysis": "standoff.service.live.analysis",
    "messenger": "standoff.service.live.messenger",
    "page": "standoff.service.status",
}


def main(process: str, folder: str, *words: str) -> None:
    """Run it until the supervisor is gone, or asks for the end.

    Args:
        process: One of the four.
        folder: Of the workplace.
        words: The stream of a capture, or `--spare`.
    """
    module, workplace = import_module(_MODULES[process]), Workplace(Path(folder))
    if SPARE in words and not sys.stdin.readline():
        return
    begin_log(workplace.secrets())
    try:
        module.run(workplace, *(word for word in words if word != SPARE))
    except KeyboardInterrupt:
        pass
    except Exception as error:  # noqa: BLE001 - said as one line of the log; the supervisor starts it again
        log_of(process).critical("ended", error=str(error) or type(error).__name__, exc_info=True)
        raise SystemExit(1) from None


if __name__ == "__main__":
    main(*sys.argv[1:])
