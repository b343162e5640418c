"""The counting sort of captured fragments against a plain sort, for any list."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from renderer.csr import bin_fragments, sort_fragments

PIXELS = 6


@st.composite
def lists(draw: st.DrawFn) -> tuple[np.ndarray, np.ndarray]:
    """Keys and places: few different depths and colours, so that they tie, and runs on both sides of every limit."""
    count = draw(st.integers(0, 160))
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    depth = rng.choice(np.array([0.5, 1.0, 1e-40, 3e38], dtype=np.float32), count).view(np.uint32).astype(np.uint64)
    colour = rng.integers(0, draw(st.sampled_from([2, 2**32])), count).astype(np.uint64)
    pixel = rng.integers(0, draw(st.integers(1, PIXELS)), count)
    return depth << np.uint64(32) | colour, (pixel << 8 | rng.integers(0, 256, count)).astype(np.uint32)


@given(lists())
def test_runs_are_those_of_a_plain_sort(given: tuple[np.ndarray, np.ndarray]) -> None:
    keys, places = given
    offsets, colour, depth, facing = bin_fragments(keys, places, PIXELS)
    for p in range(PIXELS):
        mine = np.flatnonzero(places >> 8 == p)
        run = np.sort(keys[mine])
        got = depth[offsets[p] : offsets[p + 1]].view(np.uint32).astype(np.uint64) << np.uint64(32)
        assert np.array_equal(got | colour[offsets[p] : offsets[p + 1]], run)
        nearest = [places[i] & 255 for i in mine if keys[i] >> np.uint64(32) == run[0] >> np.uint64(32)]
        assert facing[p] == max(nearest, default=0)
    assert offsets[-1] == len(keys)


@given(lists(), st.integers(0, 2**32))
def test_the_order_of_the_list_changes_nothing(given: tuple[np.ndarray, np.ndarray], seed: int) -> None:
    keys, places = given
    order = np.random.default_rng(seed).permutation(len(keys))
    for one, other in zip(
        bin_fragments(keys, places, PIXELS), bin_fragments(keys[order], places[order], PIXELS), strict=True
    ):
        assert np.array_equal(one, other)


@given(lists())
def test_sort_in_place_is_a_plain_sort(given: tuple[np.ndarray, np.ndarray]) -> None:
    keys = given[0]
    offsets = np.array([0, len(keys) // 3, len(keys) // 3, len(keys)])
    expected = np.concatenate([np.sort(keys[a:b]) for a, b in pairwise(offsets)])
    sort_fragments(offsets, keys)
    assert np.array_equal(keys, expected)
