"""Rows of numbers about pictures that were shown, as CSV: one for each picture, the same columns everywhere."""

from __future__ import annotations

import csv
import fcntl
import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from evaluation.viewer.comparing import Compared
from evaluation.viewer.studio import Shot
from evaluation.writing import replacing
from schemas.problem import ExitCode, Problem

Row = dict[str, str | int | float | None]

COLUMNS = (
    "frame", "side", "technique", "bundle", "view", "width", "height", "budget_factor", "budget", "tail", "g",
    "fragments", "captured", "k_min", "k_max", "pool_bytes", "total_bytes", "frame_ms", "mse", "mse_display", "psnr",
    "flip",
)  # fmt: skip
"""Before the passes. `mse` and `psnr` are of 8-bit sRGB in [0,1], `mse_display` of sRGB before rounding; an empty
`psnr` is no error, an empty `flip` was not asked for."""
PASS = "ms_"
"""What the name of a pass's column begins with."""


def row(frame: int, side: str, shot: Shot, compared: Compared, bundle: str) -> Row:
    """The numbers of a picture.

    Args:
        frame: Number of the frame.
        side: `left` or `right`.
        shot: The picture.
        compared: Against the exact one.
        bundle: Name of the bundle that was read; empty: none.
    """
    wish, rendered = shot.wish, shot.rendered
    return {
        "frame": frame,
        "side": side,
        "technique": wish.technique,
        "bundle": bundle,
        "view": wish.view.name,
        "width": wish.size[0],
        "height": wish.size[1],
        "budget_factor": wish.factor,
        "budget": shot.budget.fragments,
        "tail": shot.budget.tail,
        "g": shot.budget.g,
        "fragments": compared.fragments,
        "captured": rendered.captured,
        "k_min": compared.k[0],
        "k_max": compared.k[1],
        "pool_bytes": rendered.pool_bytes,
        "total_bytes": rendered.total_bytes,
        "frame_ms": shot.recording.milliseconds,
        "mse": compared.mse,
        "mse_display": compared.mse_display,
        "psnr": compared.psnr,
        "flip": compared.flip,
        **{f"{PASS}{name}": taken for name, taken in shot.recording.passes.items()},
    }


def write(path: Path, rows: Sequence[Row]) -> None:
    """Write rows; a pass that only some techniques have is an empty cell of the others."""
    passes = dict.fromkeys(name for each in rows for name in each if name not in COLUMNS)
    with replacing(path) as made, made.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.DictWriter(stream, [*COLUMNS, *passes], lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def append(path: Path, rows: Sequence[Row]) -> None:
    """Write rows behind those that a file has, if it is there; processes that do so at once wait for each other.

    Raises:
        Problem: What is there is no such file, or it cannot be written.
    """
    with _alone(path.parent):
        write(path, [*_there(path), *rows])


def check(path: Path) -> None:
    """Refuse a file that rows cannot be added to, before there are any.

    Raises:
        Problem: What is there is no such file.
    """
    _there(path)


@contextmanager
def _alone(folder: Path) -> Iterator[None]:
    """Holds a folder against all others that ask for it like this; the lock ends with the process at the latest."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        handle = os.open(folder, os.O_RDONLY)
        try:
            fcntl.flock(handle, fcntl.LOCK_EX)
            yield
        finally:
            os.close(handle)
    except OSError as error:
        raise Problem(
            f"{folder} cannot be used: {error.strerror}.", "Name another place.", ExitCode.TRY_AGAIN
        ) from error


def _there(path: Path) -> list[Row]:
    return _read(path) if path.exists() else []


def _read(path: Path) -> list[Row]:
    refused = Problem(f"{path} is no file of statistics.", "Name another one with --csv.")
    try:
        with path.open(encoding="utf-8", newline="") as stream:
            reader = csv.DictReader(stream, strict=True)
            names = reader.fieldnames or []
            if not all(name in COLUMNS or name.startswith(PASS) for name in names) or "frame" not in names:
                raise refused
            rows: list[Row] = [dict(each) for each in reader]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise refused from error
    if any(None in each for each in rows):  # a line has more cells than there are columns
        raise refused
    return rows
