"""Synthetic fragment dumps: random ones of any size, and ones spelled out pixel by pixel."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from schemas.fragments import FragmentDump


def random_dump(width: int, height: int, max_n: int, seed: int, alpha: float | None = None) -> FragmentDump:
    """A dump with random counts, alphas, colours and depths, including empty pixels and equal depths.

    Args:
        width: Pixels per row.
        height: Rows.
        max_n: Largest number of fragments of a pixel; counts are uniform in 0..max_n.
        seed: Equal seeds give equal dumps.
        alpha: One alpha for all fragments, or None for random ones in 1/255..254/255.

    Returns:
        A valid dump, fragments front to back, equal depths ordered by packed colour.
    """
    rng = np.random.default_rng(seed)
    counts = rng.integers(0, max_n + 1, width * height)
    total = int(counts.sum())
    pixel = np.repeat(np.arange(width * height), counts)
    rgba = rng.integers(0, 256, (total, 4), dtype=np.uint8)
    rgba[:, 3] = rng.integers(1, 255, total) if alpha is None else round(alpha * 255)
    # A pixel's fragments share most of their colour and its depths are coarse, so near ties and ties occur.
    rgba[:, :3] = rgba[:, :3] // 2 + rng.integers(0, 128, (width * height, 3), dtype=np.uint8)[pixel]
    depth = (1.0 + rng.integers(0, 64 * max(max_n, 1), total) / 64.0).astype(np.float32)
    order = np.lexsort((rgba.view("<u4")[:, 0], depth, pixel))
    return FragmentDump(
        width=width,
        height=height,
        offsets=np.concatenate([[0], np.cumsum(counts)]).astype(np.int64),
        rgba=np.ascontiguousarray(rgba[order]),
        depth=depth[order],
        background=rng.integers(0, 256, (width * height, 3), dtype=np.uint8),
        facing=np.where(counts > 0, rng.integers(0, 256, width * height), 0).astype(np.uint8),
    )


def dump_of(
    pixels: Sequence[tuple[NDArray[np.uint8], NDArray[np.float32]]], background: Sequence[int] = (255, 255, 255)
) -> FragmentDump:
    """A dump one pixel high with the given fragments.

    Args:
        pixels: For each pixel its `rgba` uint8 [n, 4] and `depth` float32 [n], in the order they shall have.
        background: Stored (gamma-2) background colour of all pixels.
    """
    counts = [len(depth) for _, depth in pixels]
    return FragmentDump(
        width=len(pixels),
        height=1,
        offsets=np.concatenate([[0], np.cumsum(counts)]).astype(np.int64),
        rgba=np.concatenate([np.empty((0, 4), np.uint8), *(np.asarray(rgba, np.uint8) for rgba, _ in pixels)]),
        depth=np.concatenate([np.empty(0, np.float32), *(np.asarray(depth, np.float32) for _, depth in pixels)]),
        background=np.tile(np.asarray(background, np.uint8), (len(pixels), 1)),
        facing=np.full(len(pixels), 255, np.uint8),
    )
