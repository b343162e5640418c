"""Algorithm 1 of DHOIT with a heap, as its authors print it: in plain Python, and compiled as well as it can be.

Both take one fragment at a time from the pixel whose error after that is smallest, ties by pixel index, and note k
whenever one of the budgets is reached. They are what `labeller.greedy` is measured against, and must equal.
"""

from __future__ import annotations

import heapq
from collections.abc import Sequence

import numpy as np
from numba import njit
from numpy.typing import NDArray

from labeller.curves import Curves
from labeller.selection import ascending_keys

_CHILDREN = 4
"""Of a node of the compiled heap: half the depth of a binary one, and a node's children share a cache line."""


def python_heap(curves: Curves, budgets: Sequence[int], least: int) -> list[NDArray[np.int32]]:
    """The literal heap: `labeller.reference.heap_removal` over plain lists, for several budgets in one descent.

    Args:
        curves: Error curves of a view.
        budgets: F of each result, falling.
        least: No pixel goes below `min(least, n)`.

    Returns:
        int32 [P] for each budget.
    """
    error, start = curves.error.tolist(), curves.offsets[:-1].tolist()
    k: list[int] = curves.counts.tolist()
    heap = [(error[start[p] + n - 1], p) for p, n in enumerate(k) if n > least]
    heapq.heapify(heap)
    used, kept = sum(k), []
    for budget in budgets:
        while used > budget and heap:
            _, p = heapq.heappop(heap)
            k[p] -= 1
            used -= 1
            if k[p] > least:
                heapq.heappush(heap, (error[start[p] + k[p] - 1], p))
        kept.append(np.array(k, dtype=np.int32))
    return kept


def compiled_heap(curves: Curves, budgets: Sequence[int], least: int) -> list[NDArray[np.int32]]:
    """The same, compiled: 64-bit nodes (key above, pixel below) in a 4-ary heap whose top is replaced in place.

    Args:
        curves: Error curves of a view.
        budgets: F of each result, falling.
        least: No pixel goes below `min(least, n)`.

    Returns:
        int32 [P] for each budget.
    """
    counts, starts = curves.counts, curves.offsets[:-1]
    pixels = np.flatnonzero(counts > least)
    first = ascending_keys(curves.error[starts[pixels] + counts[pixels] - 1])
    heap = (first.astype(np.uint64) << np.uint64(32)) | pixels.astype(np.uint64)
    # Where in the curves a pixel is, and where it ends: together, so that a removal reads one line of them.
    places = np.stack([starts + counts, starts + np.minimum(counts, least)], axis=1).astype(np.uint64)
    out = np.empty((len(budgets), len(counts)), dtype=np.int32)
    _descend(curves.error, heap, np.array(budgets, dtype=np.int64), int(counts.sum()), starts, places, out)
    return list(out)


@njit(cache=True)
def _sink(heap: NDArray[np.uint64], size: np.uint64, at: np.uint64, node: np.uint64) -> None:
    """Put a node where the one at `at` was: smaller children come up until it fits. Unsigned: no index from the end."""
    while True:
        child = np.uint64(_CHILDREN) * at + np.uint64(1)
        if child >= size:
            break
        least, smallest = child, heap[child]
        for step in range(1, _CHILDREN):
            other = child + np.uint64(step)
            if other < size and heap[other] < smallest:
                least, smallest = other, heap[other]
        if node <= smallest:
            break
        heap[at] = smallest
        at = least
    heap[at] = node


@njit(cache=True)
def _descend(
    error: NDArray[np.float32],
    heap: NDArray[np.uint64],
    budgets: NDArray[np.int64],
    used: int,
    starts: NDArray[np.int64],
    places: NDArray[np.uint64],
    out: NDArray[np.int32],
) -> None:
    size, top, one = np.uint64(len(heap)), np.uint64(0), np.uint64(1)
    for at in range((len(heap) - 2) // _CHILDREN, -1, -1):
        _sink(heap, size, np.uint64(at), heap[at])
    bits = error.view(np.uint32)
    for b in range(len(budgets)):
        while used > budgets[b] and size > top:
            p = heap[top] & np.uint64(0xFFFFFFFF)
            place = places[p, top] - one
            places[p, top] = place
            used -= 1
            if place > places[p, one]:
                # Errors are not negative: with the sign set, their bits are in their order (`ascending_keys`).
                key = np.uint64(bits[place - one] | np.uint32(0x80000000))
                _sink(heap, size, top, (key << np.uint64(32)) | p)
            else:
                size -= one
                if size > top:
                    _sink(heap, size, top, heap[size])
        for i in range(len(starts)):
            out[b, i] = np.int64(places[i, 0]) - starts[i]
