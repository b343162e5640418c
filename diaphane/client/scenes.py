"""Scenes of a server: uploads that go on where they stopped, and the checks of what was uploaded."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final

import httpx

from diaphane.client.group import Group, segment
from diaphane.client.packing import Package, pack
from diaphane.client.records import Record, Records
from diaphane.client.transport import RefusedRequest
from schemas.problem import ExitCode, Problem

Advance = Callable[[int], None]
"""Is told how many bytes more have arrived."""

_HASHES_PER_REQUEST: Final = 4000
_LONGEST_POLL_SECONDS: Final = 2.0


class Scenes(Group):
    """Scenes of a server."""

    def add(self, path: str | Path, name: str | None = None) -> Record:
        """Uploads a scene with all that it refers to, as far as the server lacks it, and waits for its check.

        Args:
            path: Its root file: usd, usda, usdc, usdz or glb.
            name: What it is called; None: the file's name without its suffix.

        Returns:
            The scene, accepted or rejected.

        Raises:
            Problem: There is no such file, or the server refuses it.
        """
        return self.wait(str(self.upload(pack(Path(path), name))["id"]))

    def get(self, scene_id: str) -> Record:
        """A scene."""
        return self._ask("GET", f"/v1/scenes/{segment(scene_id)}")

    def list(self, limit: int | None = None) -> Records:
        """Scenes, newest first."""
        return self._items("/v1/scenes", limit=limit)

    def upload(self, package: Package, advance: Callable[[str, int], None] = lambda _name, _bytes: None) -> Record:
        """Uploads what the server lacks of a scene and registers it; the same files are the same scene.

        Args:
            package: The scene.
            advance: Is told the name of a file and how many bytes of it more have arrived.
        """
        hashes = {name: _sha256(path) for name, path in package.files.items()}
        lacking = self.missing(sorted(set(hashes.values())))
        for name, sha256 in hashes.items():
            if sha256 in lacking:
                self.upload_file(package.files[name], sha256, lambda count, name=name: advance(name, count))  # type: ignore[misc]
                lacking.discard(sha256)
        body = {"name": package.name, "root": package.root, "files": hashes}
        return self._ask("POST", "/v1/scenes", json=body)

    def wait(
        self, scene_id: str, patience: float = 1800.0, waiting: Callable[[float, Record], None] = lambda *_: None
    ) -> Record:
        """The scene once it has been checked: accepted or rejected.

        Args:
            scene_id: Its id.
            patience: Seconds at most.
            waiting: Is told, now and then, for how many seconds the check has been waited for, and of which scene.

        Raises:
            Problem: It takes longer than `patience` seconds.
        """
        start, wait = time.monotonic(), 0.1
        while True:
            scene = self.get(scene_id)
            if scene["state"] != "checking":
                return scene
            waited = time.monotonic() - start
            waiting(waited, scene)
            if waited > patience:
                raise Problem(
                    f"The scene {scene_id} is still being checked.",
                    "Look at `diaphane workers`: is there one with the role render? Then run it again.",
                    ExitCode.TRY_AGAIN,
                )
            time.sleep(wait)
            wait = min(_LONGEST_POLL_SECONDS, 1.5 * wait)

    def missing(self, hashes: Sequence[str]) -> set[str]:
        """Those of some hex sha256 whose content the server does not have yet."""
        lacking: set[str] = set()
        for start in range(0, len(hashes), _HASHES_PER_REQUEST):
            asked = list(hashes[start : start + _HASHES_PER_REQUEST])
            lacking |= set(self._ask("POST", "/v1/blobs/missing", json={"sha256": asked})["missing"])
        return lacking

    def upload_file(self, path: Path, sha256: str, advance: Advance = lambda _: None) -> None:
        """Sends a file in parts; goes on with an upload of the same content that was broken off.

        Args:
            path: The file.
            sha256: Hex hash of its content.
            advance: Is told of each part.

        Raises:
            Problem: The server refuses it, or the file changed meanwhile.
        """
        size = path.stat().st_size
        begun = self._ask("POST", "/v1/uploads", json={"sha256": sha256, "bytes": size})
        if begun.get("complete"):
            advance(size)
            return
        received, told = int(begun.get("received", 0)), 0
        with path.open("rb") as stream:
            while True:
                advance(received - told)
                told = received
                stream.seek(received)
                part = stream.read(int(begun["part_bytes"]))
                if received + len(part) > size or (not part and received < size):
                    raise Problem(f"{path} changed while it was uploaded.", "Run it again.", ExitCode.TRY_AGAIN)
                state = self._send_part(begun["id"], received, part)
                received = int(state.get("received", received + len(part)))
                if state.get("complete"):
                    advance(size - told)
                    return

    def _send_part(self, upload: str, offset: int, part: bytes) -> Record:
        path = f"/v1/uploads/{upload}"
        headers = {"Upload-Offset": str(offset), "Content-Type": "application/octet-stream"}
        try:
            return self._ask("PATCH", path, content=part, headers=headers)
        except RefusedRequest as refused:
            if refused.status != httpx.codes.CONFLICT:
                raise
        # The part had arrived, and the answer was lost: the upload itself says where it is.
        state = self._ask("GET", path)
        if int(state.get("received", offset)) == offset and not state.get("complete"):
            raise Problem("The server refuses the next part of the upload.", "Run it again.", ExitCode.TRY_AGAIN)
        return state


def _sha256(path: Path) -> str:
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()
