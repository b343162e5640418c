"""`diaphane workers`: who does the work, and how much waits."""

from __future__ import annotations

from diaphane.cli import output
from diaphane.cli.lines import print_columns
from diaphane.cli.server import DEFAULT_URL, KeyFileOption, UrlOption, connect
from diaphane.cli.state import JsonOption


def workers(url: UrlOption = DEFAULT_URL, key_file: KeyFileOption = None, as_json: JsonOption = False) -> None:
    """Queues of each role, and the processes that take from them."""
    found = connect(url, key_file).workers()
    if as_json:
        output.print_json(found)
        return
    print_columns(("role", "queued", "running"), [(q["role"], q["queued"], q["running"]) for q in found["queues"]])
    rows = [
        (e["id"], e["host"], ",".join(e["roles"]), "alive" if e["alive"] else "gone", e["last_seen"])
        for e in found["executors"]
    ]
    print()
    print_columns(("process", "host", "roles", "state", "last seen"), rows)
