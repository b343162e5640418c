"""Which files a local scene consists of, for an upload: the root file and all it depends on, by relative name."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

from schemas.problem import ExitCode, Problem

_SINGLE = (".usdz", ".glb")
_LAYERED = (".usd", ".usda", ".usdc")


@dataclass(frozen=True, slots=True)
class Package:
    """A scene as it is uploaded.

    Attributes:
        name: What its owner calls it.
        root: The file that is opened, by its name in `files`.
        files: Relative name, with slashes -> local file.
        missing: Names that the scene refers to and that do not exist.
    """

    name: str
    root: str
    files: dict[str, Path]
    missing: tuple[str, ...] = ()


def pack(path: Path, name: str | None = None) -> Package:
    """The files of a scene.

    Args:
        path: The file that is opened: usd, usda, usdc, usdz or glb.
        name: What it is called; None: the file's name without its suffix.

    Raises:
        Problem: There is no such file, or it is of another kind.
    """
    if not path.is_file():
        what = f"{path} is a folder." if path.is_dir() else f"There is no file {path}."
        raise Problem(what, "Name the scene's root file.", ExitCode.NOT_FOUND)
    suffix = path.suffix.lower()
    if suffix not in (*_SINGLE, *_LAYERED):
        raise Problem(f"{path} is not a scene that can be uploaded.", f"Use {', '.join((*_LAYERED, *_SINGLE))}.")
    name = name or path.stem
    if suffix in _SINGLE:
        return Package(name, path.name, {path.name: path})
    files, missing = _dependencies(path)
    root = path.resolve()
    # Layers may refer upwards, as far as the upload reaches: the folder that holds all of them is its top.
    top = Path(os.path.commonpath([root.parent, *(file.parent for file in files)]))
    named = {file.relative_to(top).as_posix(): file for file in (root, *files)}
    unnamed = tuple(sorted({Path(os.path.relpath(file, top)).as_posix() for file in missing}))
    return Package(name, root.relative_to(top).as_posix(), named, unnamed)


def _dependencies(path: Path) -> tuple[set[Path], set[Path]]:
    """Files that the root layer depends on, and those of them that are missing."""
    try:
        from renderer.usd.digest import dependencies
    except ImportError as error:
        raise Problem(
            f"The files of {path} cannot be determined without OpenUSD.",
            "Install usd-core, or pack the scene into one .usdz file.",
        ) from error
    root = path.resolve()
    files = dependencies(path)
    # Names are made by the path as written: a link keeps its name, and is sent as the file that it leads to.
    absolute = {Path(os.path.abspath(root.parent / file)) for file in files}  # noqa: PTH100 - resolve follows links
    found = {file for file in absolute if file.is_file()}
    return found, absolute - found
