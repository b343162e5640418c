"""Merging of vertices that are equal in every attribute."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numba import njit
from numpy.typing import NDArray

_MIX = np.uint64(0x9E3779B97F4A7C15)
"""2^64 / golden ratio: multiplying by it spreads low bits upwards."""


def weld(columns: Sequence[NDArray[np.generic]]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Finds rows that are equal in all columns.

    Args:
        columns: Arrays [n, ...] whose rows belong together; a row is a multiple of four bytes long.

    Returns:
        The rows to keep [u], in the order they come in, and for every row the number of the kept one [n].
    """
    rows = len(columns[0])
    # Most meshes have one colour and no texture coordinates: what is the same everywhere decides nothing.
    varying = [column for column in columns if rows and not np.all(column == column[0])]
    words = np.concatenate([_words(column) for column in varying], axis=1) if varying else np.zeros((rows, 1), "u4")
    kept, number = np.empty(rows, dtype=np.int64), np.empty(rows, dtype=np.int64)
    table = np.full(1 << (2 * rows).bit_length(), -1, dtype=np.int64)
    count = _number(words, table, kept, number)
    return kept[:count], number


def _words(column: NDArray[np.generic]) -> NDArray[np.uint32]:
    """The bytes of each row as 32-bit words."""
    rows = np.ascontiguousarray(column)
    # Adding 0 turns -0 into 0, which is the same number in other bits.
    if np.issubdtype(rows.dtype, np.floating):
        rows = rows + rows.dtype.type(0)
    return rows.reshape(len(rows), -1).view(np.uint32)


@njit(inline="always")
def _equal(a: NDArray[np.uint32], b: NDArray[np.uint32]) -> bool:
    for i in range(len(a)):  # noqa: SIM110 (compiled)
        if a[i] != b[i]:
            return False
    return True


@njit(cache=True)
def _number(
    words: NDArray[np.uint32], table: NDArray[np.int64], kept: NDArray[np.int64], number: NDArray[np.int64]
) -> int:
    """Numbers rows by what is in them, with a hash table of open addresses; a power of two of free places.

    Returns:
        How many different rows there are.
    """
    mask = np.uint64(len(table) - 1)
    count = 0
    for row in range(len(words)):
        key = np.uint64(0)
        for word in words[row]:
            key = (key ^ np.uint64(word)) * _MIX
            key ^= key >> np.uint64(29)
        place = key & mask
        while table[place] >= 0 and not _equal(words[kept[table[place]]], words[row]):
            place = (place + np.uint64(1)) & mask
        if table[place] < 0:
            table[place] = count
            kept[count] = row
            count += 1
        number[row] = table[place]
    return count
