from __future__ import annotations

import io
import json
import logging
from collections.abc import Iterator

import pytest
import structlog

from services import logs

SECRET = "dia_0123456789ab_" + "A" * 43


@pytest.fixture
def stream() -> Iterator[io.StringIO]:
    root = logging.getLogger()
    handlers, level = root.handlers[:], root.level
    found = io.StringIO()
    logs.set_up(stream=found)
    yield found
    root.handlers[:] = handlers
    root.setLevel(level)
    structlog.reset_defaults()


def _lines(stream: io.StringIO) -> list[dict[str, object]]:
    return [json.loads(line) for line in stream.getvalue().splitlines()]


def test_a_line_is_an_object_with_the_ids_that_are_bound(stream: io.StringIO) -> None:
    with structlog.contextvars.bound_contextvars(request_id="req_1", job_id="job_1"):
        structlog.get_logger("a").info("begun", count=3)
        logging.getLogger("b").warning("of a library: %s", "x")
    logging.getLogger("c").warning("later")
    first, second, third = _lines(stream)
    assert (first["event"], first["count"], first["level"], first["logger"]) == ("begun", 3, "info", "a")
    assert (second["event"], second["job_id"]) == ("of a library: x", "job_1")
    assert first["request_id"] == second["request_id"] == "req_1"
    assert "job_id" not in third


@pytest.mark.parametrize(
    ("text", "secret"),
    [
        (f"key {SECRET}", "A" * 43),
        ("connect postgresql://user:hunter2@host/db", "hunter2"),
        ("connect postgresql+psycopg://user:p@ss:word@host:5432/db failed", "p@ss:word"),
        ("host=h password=hunter2 dbname=d", "hunter2"),
        ("Authorization: Bearer abcdefghijkl", "abcdefghijkl"),
        ("{'authorization': 'Basic dXNlcjpwYXNz'}", "dXNlcjpwYXNz"),
        ("(b'authorization', b'Bearer abcdefghijkl')", "abcdefghijkl"),
    ],
)
def test_secrets_are_hidden_wherever_they_stand(stream: io.StringIO, text: str, secret: str) -> None:
    log = structlog.get_logger("a")
    log.info(text)
    log.info("x", value=text, deep=[{"inner": (text, text.encode())}])
    logging.getLogger("b").warning("%s", text)
    try:
        raise ValueError(text)
    except ValueError:
        log.exception("failed")
        logging.getLogger("b").exception("failed")
    assert len(_lines(stream)) == 5
    assert secret not in stream.getvalue()
    assert logs.HIDDEN in stream.getvalue()


def test_names_that_tell_a_secret_hide_their_value_and_others_stay(stream: io.StringIO) -> None:
    structlog.get_logger("a").info("x", signing_key="plain", headers={"Authorization": "plain"}, key_id="key_1")
    (line,) = _lines(stream)
    assert "plain" not in stream.getvalue()
    assert line["key_id"] == "key_1"
    assert logs.redact("https://example.org/a@b and dia_0123456789ab") == "https://example.org/a@b and dia_0123456789ab"
