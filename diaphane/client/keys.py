"""Keys of a server, and where a user keeps one."""

from __future__ import annotations

import os
import shlex
import stat
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

from diaphane.client.group import Group, segment
from diaphane.client.records import Record, Records
from schemas.problem import ExitCode, Problem

KEY_VARIABLE: Final = "DIAPHANE_KEY"
_READ_BY_OTHERS: Final = stat.S_IRGRP | stat.S_IROTH


class Keys(Group):
    """Keys of a server."""

    def create(self, name: str, scopes: Sequence[str], expires: str | None, bounds: Mapping[str, int | None]) -> Record:
        """Makes a key; its secret is in this answer and nowhere else."""
        body = {"name": name, "scopes": list(scopes), "expires": expires, "bounds": dict(bounds)}
        return self._ask("POST", "/v1/keys", json=body, repeatable=False)

    def list(self) -> Records:
        """All keys, without their secrets."""
        return self._items("/v1/keys")

    def revoke(self, key_id: str) -> None:
        """Ends a key."""
        self._transport.request("DELETE", f"/v1/keys/{segment(key_id)}")


def read_key(key_file: Path | None) -> str | None:
    """The API key: from a file, else from the environment; None if there is none.

    Raises:
        Problem: The file cannot be read, others of this machine can read it, or what is there cannot be a key.
    """
    source, text, mode = f"The variable {KEY_VARIABLE}", os.environ.get(KEY_VARIABLE, ""), 0
    if key_file is not None:
        source = f"The file {key_file}"
        try:
            mode = key_file.stat().st_mode
            text = key_file.read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as error:
            raise Problem(f"{source} cannot be read.", "Check the path of the key file.", ExitCode.AUTH) from error
    key = text.strip()
    if not (key.isascii() and key.isprintable()) or " " in key:
        raise Problem(f"{source} does not hold an API key.", "A key is one word: dia_...", ExitCode.AUTH)
    if mode & _READ_BY_OTHERS:
        raise Problem(
            f"{source} can be read by other users of this machine.",
            f"Keep it to yourself: `chmod 600 {shlex.quote(str(key_file))}`.",
            ExitCode.AUTH,
        )
    return key or None
