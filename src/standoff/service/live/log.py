"""Logs as JSON lines, each with what it is about; credentials never."""

from __future__ import annotations

import logging
import sys
from collections.abc import MutableMapping
from typing import Any

import structlog

from standoff.stages.frames import masked


def begin_log(secrets: tuple[str, ...] = (), *, level: int = logging.INFO) -> None:
    """Let this process's logs, those of libraries too, go to standard error as JSON lines.

    Args:
        secrets: What is masked wherever it occurs.
        level: Of the least that is written.
    """
    mask = _masking(tuple(filter(None, secrets)))
    shared: list[structlog.typing.Processor] = [
        structlog.contextvars.merge_contextvars,
        structlog.processors.add_log_level,
        structlog.processors.TimeStamper(fmt="iso", utc=True, key="time"),
        structlog.processors.format_exc_info,
        mask,
    ]
    structlog.configure(
        processors=[*shared, structlog.stdlib.ProcessorFormatter.wrap_for_formatter],
        logger_factory=structlog.stdlib.LoggerFactory(),
        wrapper_class=structlog.stdlib.BoundLogger,
        cache_logger_on_first_use=False,
    )
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(
        structlog.stdlib.ProcessorFormatter(
            foreign_pre_chain=shared,
            processors=[
                structlog.stdlib.ProcessorFormatter.remove_processors_meta,
                mask,
                structlog.processors.JSONRenderer(ensure_ascii=False),
            ],
        )
    )
    root = logging.getLogger()
    root.handlers[:] = [handler]
    root.setLevel(logging.WARNING)
    logging.getLogger("standoff").setLevel(level)


def log_of(part: str, **about: str) -> structlog.stdlib.BoundLogger:
    """Return the log of a part of the service.

    Args:
        part: Its name.
        about: What all its lines are about.
    """
    logger: structlog.stdlib.BoundLogger = structlog.get_logger(f"standoff.live.{part}")
    return logger.bind(part=part, **about)


def _masking(secrets: tuple[str, ...]) -> structlog.typing.Processor:
    def mask(_logger: object, _method: str, event: MutableMapping[str, Any]) -> MutableMapping[str, Any]:
        for name, value in event.items():
            if isinstance(value, str):
                event[name] = masked(value, *secrets)
        return event

    return mask
