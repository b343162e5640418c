"""Dumps as plain files, for the processes that measure memory: what they load is all they hold."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path

import numpy as np

from schemas.fragments import FragmentDump

_ARRAYS = tuple(field.name for field in fields(FragmentDump) if field.name not in ("width", "height"))


def store(dump: FragmentDump, folder: Path) -> Path:
    """Writes a dump into a new folder, one `.npy` for each array, and returns the folder."""
    folder.mkdir(parents=True)
    np.save(folder / "size.npy", np.array([dump.width, dump.height]))
    for name in _ARRAYS:
        np.save(folder / f"{name}.npy", getattr(dump, name))
    return folder


def stored(folder: Path) -> FragmentDump:
    """Reads what `store` wrote."""
    width, height = np.load(folder / "size.npy")
    return FragmentDump(int(width), int(height), **{name: np.load(folder / f"{name}.npy") for name in _ARRAYS})


def dump_bytes(dump: FragmentDump) -> int:
    """Bytes of all arrays of a dump."""
    return sum(getattr(dump, name).nbytes for name in _ARRAYS)
