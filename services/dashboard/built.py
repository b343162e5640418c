"""Folders that `deploy/client/web` is built to, committed as built: their files, and answers with them."""

from __future__ import annotations

import hashlib
from functools import cached_property
from pathlib import Path
from typing import Final

from fastapi import Request, Response

from services.api.etags import is_current
from services.problems import Refusal

_HOME: Final = Path(__file__).resolve().parent / "static"
_TYPES: Final = {
    ".html": "text/html",
    ".js": "text/javascript",
    ".css": "text/css",
    ".svg": "image/svg+xml",
    ".glb": "model/gltf-binary",
    ".json": "application/json",
    ".md": "text/plain",
    ".tgz": "application/gzip",
    ".wgsl": "text/plain",
}

FOREVER: Final = {"Cache-Control": "public, max-age=31536000, immutable"}
"""Of files whose names change with their content."""
CHECKED: Final = {"Cache-Control": "no-cache"}
"""Of those that are asked for again each time."""


class Built:
    """A folder of files.

    Args:
        name: Of the folder, in `static`.

    Attributes:
        folder: Where it is; `npm run build` in `deploy/client/web` writes it.
    """

    def __init__(self, name: str) -> None:
        self.folder = _HOME / name

    @cached_property
    def files(self) -> dict[str, tuple[bytes, str]]:
        """Path in the folder -> content, and its hex sha256."""
        paths = (path for path in self.folder.rglob("*") if path.is_file())
        found = {path.relative_to(self.folder).as_posix(): path.read_bytes() for path in paths}
        return {name: (content, hashlib.sha256(content).hexdigest()) for name, content in found.items()}

    def answer(self, request: Request, name: str, headers: dict[str, str]) -> Response:
        """A file, or that whoever asks has it.

        Args:
            request: The request.
            name: Path in the folder.
            headers: Of the answer, beside its ETag.

        Raises:
            Refusal: There is no such file.
        """
        if name not in self.files:
            raise Refusal("not-found")
        content, tag = self.files[name]
        headers = {**headers, "ETag": f'"{tag}"'}
        if is_current(request, tag):
            return Response(status_code=304, headers=headers)
        return Response(content, media_type=_TYPES[Path(name).suffix], headers=headers)
