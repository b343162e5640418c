"""Structured logs: one JSON object a line on stderr, with the ids of the request and the job; never a secret.

`structlog.get_logger(__name__)` and `logging.getLogger(__name__)` end in the same place, and so do the libraries' logs.
What belongs to a request or a job is bound once (`structlog.contextvars.bound_contextvars`) and stands in every line.
"""

from __future__ import annotations

import logging
import re
import sys
from collections.abc import Mapping, MutableMapping
from typing import Any, TextIO

import structlog

HIDDEN = "[hidden]"

_PATTERNS = (
    # API keys: the id stays, so that it can be found which one it was.
    (re.compile(r"(dia_[0-9a-f]{12}_)[A-Za-z0-9_-]{8,}"), rf"\1{HIDDEN}"),
    # Passwords in URLs. Greedy to the last `@` before the host: a password may contain one.
    (re.compile(r"([a-z][a-z0-9+.-]*://[^\s:/@]*:)[^\s/]+@", re.IGNORECASE), rf"\1{HIDDEN}@"),
    (re.compile(r"(\bpassword\s*=\s*)('[^']*'|[^\s'\",;&]+)", re.IGNORECASE), rf"\1{HIDDEN}"),
    (re.compile(r"(authorization['\"]?\s*[:=,]\s*b?['\"]?)[^'\"\r\n,)]+", re.IGNORECASE), rf"\1{HIDDEN}"),
    (re.compile(r"\b((?:bearer|basic)\s+)[A-Za-z0-9._~+/=-]{8,}", re.IGNORECASE), rf"\1{HIDDEN}"),
)
_SECRET_NAMES = re.compile(
    r"authorization|password|passwd|secret|signing_key|credential|cookie|api_?key", re.IGNORECASE
)


def redact(text: str) -> str:
    """The text without API keys, passwords of URLs and Authorization headers."""
    for pattern, replacement in _PATTERNS:
        text = pattern.sub(replacement, text)
    return text


def redact_event(_logger: Any, _method: str, event: MutableMapping[str, Any]) -> MutableMapping[str, Any]:
    """Processor of structlog: hides secrets in all values, however deep."""
    return {name: _hidden(name, value) for name, value in event.items()}


def set_up(level: int | str = logging.INFO, stream: TextIO | None = None) -> None:
    """Sends all logs of the process to a stream, as lines of JSON.

    Args:
        level: Least level.
        stream: Where they go; None: stderr.
    """
    shared: list[Any] = [
        structlog.contextvars.merge_contextvars,
        structlog.stdlib.add_logger_name,
        structlog.stdlib.add_log_level,
        structlog.processors.TimeStamper(fmt="iso", utc=True),
    ]
    ending: list[Any] = [
        structlog.stdlib.ProcessorFormatter.remove_processors_meta,
        structlog.processors.format_exc_info,
        redact_event,
        structlog.processors.JSONRenderer(default=str),
    ]
    structlog.configure(
        processors=[*shared, structlog.stdlib.ProcessorFormatter.wrap_for_formatter],
        logger_factory=structlog.stdlib.LoggerFactory(),
        wrapper_class=structlog.stdlib.BoundLogger,
        cache_logger_on_first_use=False,
    )
    handler = logging.StreamHandler(stream or sys.stderr)
    handler.setFormatter(structlog.stdlib.ProcessorFormatter(foreign_pre_chain=shared, processors=ending))
    root = logging.getLogger()
    root.handlers[:] = [handler]
    root.setLevel(level)
    # Libraries that bring handlers of their own, or say too much.
    for name in ("dbos", "uvicorn", "uvicorn.error", "uvicorn.access", "sqlalchemy", "httpx", "numba"):
        logger = logging.getLogger(name)
        logger.handlers[:] = [handler] if name == "dbos" else []  # DBOS adds one where there is none
        logger.propagate = name != "dbos"
        logger.setLevel(logging.WARNING)


def _hidden(name: str, value: Any) -> Any:
    if value is not None and _SECRET_NAMES.search(name):
        return HIDDEN
    if isinstance(value, str):
        return redact(value)
    if isinstance(value, Mapping):
        return {str(key): _hidden(str(key), inner) for key, inner in value.items()}
    if isinstance(value, (list, tuple, set, frozenset)):
        return [_hidden("", inner) for inner in value]
    if isinstance(value, bytes):
        return redact(value.decode(errors="replace"))
    return value if value is None or isinstance(value, (bool, int, float)) else redact(str(value))
