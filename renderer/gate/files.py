"""The files of an upload: plain ones only, with what kind they are by their first bytes."""

from __future__ import annotations

import os
import stat
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from renderer.gate.images import HEAD, IMAGE_SUFFIXES, check_image, foreign_image, is_image
from renderer.gate.names import check_file_name
from renderer.gate.problems import RejectedScene, shown
from schemas.limits import LIMITS

Kind = Literal["layer", "package", "materialx", "image", "glb", "other"]

LAYER_SUFFIXES = (".usd", ".usda", ".usdc")
TEXT_COOKIES = (b"#usda ", b"#sdf ", b"#usd ")
CRATE_COOKIE = b"PXR-USDC"


@dataclass(frozen=True, slots=True)
class UploadedFile:
    """A plain file of an upload.

    Attributes:
        name: Relative, with `/`.
        path: Where it is.
        size: Bytes.
        kind: By suffix and first bytes.
        pixels: Of an image.
    """

    name: str
    path: Path
    size: int
    kind: Kind
    pixels: int = 0


def suffix_of(name: str) -> str:
    """The lower-case suffix with its dot."""
    return os.path.splitext(name)[1].lower()  # noqa: PTH122 (a name in a package is no path)


def list_upload(folder: Path) -> dict[str, UploadedFile]:
    """Every file of the folder by relative name.

    Raises:
        RejectedScene: One is no plain file, has a bad name, is an image that is not decoded here, or it is too much.
    """
    found: dict[str, UploadedFile] = {}
    total = 0
    for path, name in _walk(folder, ""):
        if len(found) >= LIMITS.scene_files:
            raise RejectedScene("scene-too-large", f"The upload has more than {LIMITS.scene_files} files.")
        size = path.lstat().st_size
        total += size
        if total > LIMITS.upload_bytes:
            raise RejectedScene("scene-too-large", f"The upload has more than {LIMITS.upload_bytes} bytes.")
        kind, pixels = classify(name, read_head(path, name), size)
        found[name] = UploadedFile(name, path, size, kind, pixels)
    return found


def classify(name: str, head: bytes, size: int) -> tuple[Kind, int]:
    """What a file is, and the pixels if it is an image.

    Args:
        name: Its name, in the upload or in a package.
        head: Its first HEAD bytes.
        size: All its bytes.

    Raises:
        RejectedScene: Its content is not what its suffix says, or it is an image that is not decoded here.
    """
    suffix = suffix_of(name)
    if suffix in LAYER_SUFFIXES:
        crate, text = head.startswith(CRATE_COOKIE), head.startswith(TEXT_COOKIES)
        fits = {".usd": crate or text, ".usda": text, ".usdc": crate}[suffix]
        if size and not fits:
            raise RejectedScene("scene-format", f"{shown(name)} is no USD layer of the kind that its suffix says.")
        return "layer", 0
    if suffix == ".usdz":
        return "package", 0
    if suffix == ".mtlx":
        return "materialx", 0
    if suffix == ".glb":
        return "glb", 0
    foreign = foreign_image(head)
    if foreign or suffix == ".exr":
        raise RejectedScene(
            "scene-texture", f"{shown(name)} is an image ({foreign or 'OpenEXR'}) that is not accepted."
        )
    if is_image(head):
        return "image", check_image(name, head)
    if suffix in IMAGE_SUFFIXES and size:
        raise RejectedScene("scene-texture", f"{shown(name)} is no image, as its suffix says.")
    return "other", 0


def read_head(path: Path, name: str) -> bytes:
    """The first HEAD bytes of a plain file; never waits, never follows a link.

    Raises:
        RejectedScene: It cannot be opened.
    """
    try:
        handle = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
        with os.fdopen(handle, "rb") as stream:
            return stream.read(HEAD)
    except OSError as error:
        raise RejectedScene("scene-symlink", f"{shown(name)} cannot be opened as a plain file.") from error


def _walk(folder: Path, prefix: str, depth: int = 0) -> Iterator[tuple[Path, str]]:
    with os.scandir(folder) as entries:
        for entry in sorted(entries, key=lambda e: e.name):
            name = check_file_name(f"{prefix}{entry.name}")
            mode = entry.stat(follow_symlinks=False).st_mode
            if stat.S_ISDIR(mode):
                yield from _walk(Path(entry.path), f"{name}/", depth + 1)
            elif stat.S_ISREG(mode):
                yield Path(entry.path), name
            else:
                raise RejectedScene("scene-symlink", f"{shown(name)} is a link, a pipe or a device, no plain file.")
