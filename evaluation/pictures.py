"""Pictures of an evaluation on disk: PNGs as displayed, maps as PNGs, read back for the report and the pages."""

from __future__ import annotations

from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray
from PIL import Image

_FAST = 1
"""PNG compression: a sixth of the time of the default for a tenth more bytes."""


EXACT = "exact.png"
"""File name of the reference picture."""


def stem(technique: str, budget_factor: float) -> str:
    """File name stem of a technique's pictures at a budget."""
    return f"{technique}-{budget_factor:g}"


def write_png(path: Path, pixels: NDArray[np.uint8] | NDArray[np.uint16]) -> None:
    """Write uint8 [H, W] or [H, W, 3], or uint16 [H, W].

    Args:
        path: File to write.
        pixels: The picture, row 0 at the top; RGB is sRGB.
    """
    Image.fromarray(pixels).save(path, compress_level=_FAST)


def read_png(file: Path | BinaryIO) -> NDArray[Any]:
    """Read what `write_png` wrote, in its type."""
    with Image.open(file) as image:
        return np.asarray(image)


def quantise_map(values: NDArray[np.floating]) -> NDArray[np.uint8]:
    """A map in [0,1] in 8 bits, for heat maps.

    Args:
        values: Numbers of any shape; clamped to [0,1].
    """
    steps: NDArray[np.uint8] = np.floor(np.clip(values, 0.0, 1.0) * 255.0 + 0.5).astype(np.uint8)
    return steps


def counts_map(k: NDArray[np.integer]) -> NDArray[np.uint8] | NDArray[np.uint16]:
    """Counts in as few bits as hold them exactly: 8, or 16 (where a count above 65535 is taken as that).

    Args:
        k: Whole numbers >= 0 of any shape.
    """
    if k.max(initial=0) <= 255:
        return np.asarray(k, dtype=np.uint8)
    return np.asarray(np.minimum(k, 65_535), dtype=np.uint16)
