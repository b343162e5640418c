"""Server-sent events."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from typing import Final

import httpx

from diaphane.client.records import Record

_LONGEST_EVENT: Final = 1 << 20


def server_sent(chunks: Iterator[bytes]) -> Iterator[Record]:
    """Events of a `text/event-stream`: number, kind, and the fields of their data.

    Lines end with LF or CRLF only: a Record text may hold other characters that Unicode calls line ends.

    Raises:
        httpx.RemoteProtocolError: An event is no JSON object, or longer than any of this service.
    """
    buffer, fields = b"", dict[str, str]()
    for chunk in chunks:
        *lines, buffer = (buffer + chunk).split(b"\n")
        if len(buffer) > _LONGEST_EVENT:
            raise httpx.RemoteProtocolError("an event is too long")
        for line in lines:
            name, _, value = line.removesuffix(b"\r").decode("utf-8", "replace").partition(":")
            if name:
                value = value.removeprefix(" ")
                fields[name] = f"{fields[name]}\n{value}" if name == "data" and name in fields else value
            elif not line.strip():
                if "data" in fields and "id" in fields:
                    yield _event(fields)
                fields = {}


def _event(fields: Mapping[str, str]) -> Record:
    try:
        data, number = json.loads(fields["data"]), int(fields["id"])
    except ValueError as error:
        raise httpx.RemoteProtocolError("an event cannot be read") from error
    if isinstance(data, dict) and {"kind", "data"} <= set(data):
        return Record({**data, "number": number})
    return Record({"number": number, "kind": fields.get("event", "log"), "data": data})
