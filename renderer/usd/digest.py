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
    for name, file in sorted(_dependencies(root).items()):
        content = _file_hash(file) if file is not None else "missing"
        total.update(f"{name}\0{content}\n".encode())
    return total.hexdigest()


def _dependencies(root: Path) -> dict[str, Path | None]:
    """Relative name of each dependency and the file it is in; None for what does not exist."""
    if root.suffix.lower() == ".usdz":
        return {root.name: root}
    try:
        with usd_diagnostics(WarningLog()):
            layers, assets, missing = UsdUtils.ComputeAllDependencies(str(root))
    except Tf.ErrorException as error:
        raise Problem(f"{root} cannot be read as USD.", "Export it again.", ExitCode.USAGE) from error
    found: dict[str, Path | None] = {root.name: root}
    # A file inside a package (`x.usdz[y.png]`) is the package's.
    names = [layer.realPath or layer.identifier for layer in layers] + [str(a) for a in assets]
    files = [Path(str(name).split("[", 1)[0]) for name in (*names, *missing)]
    files += [image for file in files if file.suffix.lower() == ".mtlx" for image in referenced_files(file)]
    for file in files:
        found[os.path.relpath(file, root.parent)] = file if file.is_file() else None
    return found


def _file_hash(file: Path) -> str:
    with file.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()
