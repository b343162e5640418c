"""CSR on the CPU: offsets from counts, an unordered list of fragments to sorted runs of pixels."""

from __future__ import annotations

import numba
import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

_INSERTION = 24
"""Up to this many fragments insertion sort beats the general one (most pixels)."""
_RANKED = 48
"""Up to this many fragments, ranks by comparing all pairs beat the general sort."""
_BLOCKS = 256
"""Runs of pixels that threads take in turns."""
_PARTS = 4
"""Most parts that a list is counted in at once: each needs a counter for every pixel."""


def offsets_of(counts: NDArray[np.integer]) -> NDArray[np.int64]:
    """Exclusive prefix sum: int64 [P+1] of counts [P].

    Args:
        counts: Integers [P], entries of each row.
    """
    offsets = np.zeros(len(counts) + 1, dtype=np.int64)
    np.cumsum(counts, out=offsets[1:])
    return offsets


@njit(parallel=True, cache=True, nogil=True)
def sort_fragments(offsets: NDArray[np.int64], keys: NDArray[np.uint64]) -> None:
    """Sort the keys of every pixel in place.

    Args:
        offsets: int64 [P+1].
        keys: uint64 [N], depth bits in the high word, packed colour in the low one.
    """
    for p in prange(len(offsets) - 1):
        _sort_run(keys, offsets[p], offsets[p + 1])


Scratch = tuple[NDArray[np.uint64], NDArray[np.uint8]]
"""Keys and facings of as many fragments as a list has, or more."""


def new_scratch(fragments: int) -> Scratch:
    """Space for `bin_fragments`, at 9 bytes a fragment."""
    return np.empty(fragments, dtype=np.uint64), np.empty(fragments, dtype=np.uint8)


def bin_fragments(
    keys: NDArray[np.uint64], places: NDArray[np.uint32], pixels: int, scratch: Scratch | None = None
) -> tuple[NDArray[np.int64], NDArray[np.uint32], NDArray[np.float32], NDArray[np.uint8]]:
    """From an unordered list of fragments to the sorted runs of every pixel: a counting sort, then a sort inside.

    The result does not depend on the order of the list.

    Args:
        keys: uint64 [N], depth bits in the high word, packed colour in the low one.
        places: uint32 [N], pixel << 8 | facing.
        pixels: P.
        scratch: Space for N fragments, kept by the caller: fresh pages cost as much as writing them.

    Returns:
        Offsets int64 [P+1]; packed colours uint32 [N] and depths float32 [N], metres, front to back in each pixel,
        ties by colour; facing uint8 [P], the greatest of the fragments at the nearest depth, 0 where there is none.
    """
    counts = _histograms(places, pixels, min(numba.get_num_threads(), _PARTS))
    offsets = _cursors(counts)
    run_keys, run_facing = new_scratch(len(keys)) if scratch is None else scratch
    _scatter(keys, places, counts, run_keys, run_facing)
    colour, depth = np.empty(len(keys), dtype=np.uint32), np.empty(len(keys), dtype=np.uint32)
    facing = np.zeros(pixels, dtype=np.uint8)
    _sort_and_split(offsets, run_keys, run_facing, colour, depth, facing)
    return offsets, colour, depth.view(np.float32), facing


@njit(inline="always")
def _sort_run(keys: NDArray[np.uint64], begin: int, end: int) -> None:
    if end - begin > _INSERTION:
        keys[begin:end] = np.sort(keys[begin:end])
        return
    for i in range(begin + 1, end):
        key = keys[i]
        j = i - 1
        while j >= begin and keys[j] > key:
            keys[j + 1] = keys[j]
            j -= 1
        keys[j + 1] = key


@njit(parallel=True, cache=True, nogil=True)
def _histograms(places: NDArray[np.uint32], pixels: int, parts: int) -> NDArray[np.uint32]:
    # uint32 [parts, P]: fragments of every pixel in each part of the list.
    counts = np.zeros((parts, pixels), dtype=np.uint32)
    for part in prange(parts):
        for i in range(len(places) * part // parts, len(places) * (part + 1) // parts):
            counts[part, places[i] >> 8] += 1
    return counts


@njit(cache=True, nogil=True)
def _cursors(counts: NDArray[np.uint32]) -> NDArray[np.int64]:
    # Offsets; counts become where each part writes its first fragment of a pixel. One pass, bound by memory.
    parts, pixels = counts.shape
    offsets = np.empty(pixels + 1, dtype=np.int64)
    cursor = 0
    for p in range(pixels):
        offsets[p] = cursor
        for part in range(parts):
            count = counts[part, p]
            counts[part, p] = cursor
            cursor += count
    offsets[pixels] = cursor
    return offsets


@njit(parallel=True, cache=True, nogil=True)
def _scatter(
    keys: NDArray[np.uint64],
    places: NDArray[np.uint32],
    cursors: NDArray[np.uint32],
    run_keys: NDArray[np.uint64],
    run_facing: NDArray[np.uint8],
) -> None:
    parts = len(cursors)
    for part in prange(parts):
        for i in range(len(places) * part // parts, len(places) * (part + 1) // parts):
            p = places[i] >> 8
            at = cursors[part, p]
            run_keys[at] = keys[i]
            run_facing[at] = places[i] & 255
            cursors[part, p] = at + 1


@njit(parallel=True, cache=True, nogil=True)
def _sort_and_split(
    offsets: NDArray[np.int64],
    keys: NDArray[np.uint64],
    facings: NDArray[np.uint8],
    colour: NDArray[np.uint32],
    depth: NDArray[np.uint32],
    facing: NDArray[np.uint8],
) -> None:
    low = np.uint64(0xFFFFFFFF)
    pixels = len(offsets) - 1
    blocks = min(_BLOCKS, pixels)
    for block in prange(blocks):
        rank = np.zeros(_RANKED, dtype=np.int64)
        for p in range(pixels * block // blocks, pixels * (block + 1) // blocks):
            begin, count = offsets[p], offsets[p + 1] - offsets[p]
            if count > _RANKED:
                ordered = np.sort(keys[begin : begin + count])
                for i in range(count):
                    colour[begin + i] = np.uint32(ordered[i] & low)
                    depth[begin + i] = np.uint32(ordered[i] >> np.uint64(32))
            else:
                _rank(keys, begin, count, rank)
                for i in range(count):
                    colour[begin + rank[i]] = np.uint32(keys[begin + i] & low)
                    depth[begin + rank[i]] = np.uint32(keys[begin + i] >> np.uint64(32))
            for i in range(begin, begin + count):
                if np.uint32(keys[i] >> np.uint64(32)) == depth[begin]:
                    facing[p] = max(facing[p], facings[i])


@njit(inline="always")
def _rank(keys: NDArray[np.uint64], begin: int, count: int, rank: NDArray[np.int64]) -> None:
    # Where each key goes: every pair is compared once, without branches, so that the compiler uses vectors; half again
    # as fast as insertion. Depths are positive, so keys order as signed numbers too.
    for i in range(count):
        rank[i] = 0
        key = np.int64(keys[begin + i])
        before = np.int64(0)
        for j in range(i):
            not_after = np.int64(np.int64(keys[begin + j]) <= key)
            before += not_after
            rank[j] += 1 - not_after
        rank[i] = before
