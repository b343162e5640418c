"""The content hash of a scene: its root layer and everything that the layer depends on."""

from __future__ import annotations

import hashlib
import os
from pathlib import Path

from pxr import Tf, UsdUtils

from renderer.usd.materialx import referenced_files
from renderer.usd.stage import WarningLog, check_file, usd_diagnostics
from schemas.problem import ExitCode, Problem


def scene_digest(path: Path) -> str:
    """SHA-256 of the content of a scene, hex.

    Every layer, image and other file that the root layer depends on counts, under its name relative to the root
    layer's folder, as do the names of those that are missing; the folder itself and file times do not.

    Raises:
        Problem: The file is missing or cannot be parsed.
    """
    check_file(path)
    root = path.resolve()
    total = hashlib.sha256()
    for name, file in sorted(_named(root).items()):
        content = _file_hash(file) if file is not None else "missing"
        total.update(f"{name}\0{content}\n".encode())
    return total.hexdigest()


def dependencies(path: Path) -> list[Path]:
    """Every layer, image and other file that a root layer depends on, whether it exists or not.

    Args:
        path: The root layer; not a package.

    Raises:
        Problem: It cannot be parsed.
    """
    try:
        with usd_diagnostics(WarningLog()):
            layers, assets, missing = UsdUtils.ComputeAllDependencies(str(path.resolve()))
    except Tf.ErrorException as error:
        raise Problem(f"{path} cannot be read as USD.", "Export it again.", ExitCode.USAGE) from error
    # A file inside a package (`x.usdz[y.png]`) is the package's.
    names = [layer.realPath or layer.identifier for layer in layers] + [str(asset) for asset in assets]
    files = [Path(str(name).split("[", 1)[0]) for name in (*names, *missing)]
    return [*files, *(image for file in files if file.suffix.lower() == ".mtlx" for image in referenced_files(file))]


def _named(root: Path) -> dict[str, Path | None]:
    """Relative name of each dependency and the file it is in; None for what does not exist."""
    found: dict[str, Path | None] = {root.name: root}
    if root.suffix.lower() != ".usdz":
        for file in dependencies(root):
            found[os.path.relpath(file, root.parent)] = file if file.is_file() else None
    return found


def _file_hash(file: Path) -> str:
    with file.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()
