"""Merging of vertices that are equal in every attribute."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

_MIX = np.uint64(0x9E3779B97F4A7C15)
"""2^64 / golden ratio: multiplying by it spreads low bits upwards."""


def weld(columns: Sequence[NDArray[np.generic]]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Finds rows that are equal in all columns.

    Args:
        columns: Arrays [n, ...] whose rows belong together.

    Returns:
        The rows to keep [u], in the order they come in, and for every row the number of the kept one [n].
    """
    words = np.concatenate([_words(column) for column in columns], axis=1)
    keys = np.zeros(len(words), dtype=np.uint64)
    for word in words.T:
        keys = (keys ^ word) * _MIX
        keys ^= keys >> np.uint64(29)
    _, first, number = np.unique(keys, return_index=True, return_inverse=True)
    if not np.array_equal(words[first[number]], words):
        # Two different rows have the same key: never seen, but cheap to be right about.
        _, first, number = np.unique(words, axis=0, return_index=True, return_inverse=True)
    order = np.argsort(first)
    place = np.empty_like(order)
    place[order] = np.arange(len(order))
    return first[order], place[number.ravel()]


def _words(column: NDArray[np.generic]) -> NDArray[np.uint32]:
    """The bytes of each row as 32-bit words; rows are a multiple of four bytes long."""
    rows = np.ascontiguousarray(column)
    # Adding 0 turns -0 into 0, which is the same number in other bits.
    if np.issubdtype(rows.dtype, np.floating):
        rows = rows + rows.dtype.type(0)
    return rows.reshape(len(rows), -1).view(np.uint32)
