"""Prefix sums on the GPU against numpy: the same words, in place or not, at every size around a block."""

from __future__ import annotations

import moderngl
import numpy as np
import pytest
from numpy.typing import NDArray

from renderer.csr import offsets_of
from renderer.prefix import BLOCK, CEILING, prefix_sums, totals
from renderer.programs import Programs

SIZES = [1, 2, 255, 257, BLOCK - 1, BLOCK, BLOCK + 1, 9 * BLOCK + 777, 300 * BLOCK - 1]


@pytest.fixture(scope="module")
def programs(gl: moderngl.Context) -> Programs:
    return Programs(gl)


def words(items: int) -> NDArray[np.uint32]:
    rng = np.random.default_rng(items)
    return np.where(rng.random(items) < 0.01, 5000, rng.integers(0, 9, items)).astype(np.uint32)


@pytest.mark.parametrize("items", SIZES)
def test_offsets_and_totals_equal_numpys__items(ctx: moderngl.Context, programs: Programs, items: int) -> None:
    counts = words(items)
    offsets, sums = prefix_sums(ctx, programs, ctx.buffer(counts), items)
    assert np.array_equal(np.frombuffer(offsets.read(), dtype=np.uint32), offsets_of(counts))
    assert sums.read() == (counts.sum(), counts.max())
    assert totals(ctx, programs, ctx.buffer(counts), items).read() == (counts.sum(), counts.max())


@pytest.mark.parametrize("items", SIZES)
def test_in_place_they_are_the_same__items(ctx: moderngl.Context, programs: Programs, items: int) -> None:
    counts = words(items)
    longer = ctx.buffer(np.append(counts, np.uint32(77)))  # what is there before does not matter
    offsets, _ = prefix_sums(ctx, programs, longer, items, into=longer)
    assert offsets is longer
    assert np.array_equal(np.frombuffer(offsets.read(), dtype=np.uint32), offsets_of(counts))


def test_a_longer_buffer_is_summed_to_its_items(ctx: moderngl.Context, programs: Programs) -> None:
    counts = words(5000)
    offsets, sums = prefix_sums(ctx, programs, ctx.buffer(counts), 3000)
    assert np.array_equal(np.frombuffer(offsets.read(), dtype=np.uint32), offsets_of(counts[:3000]))
    assert sums.read() == (counts[:3000].sum(), counts[:3000].max())


@pytest.mark.parametrize("place", [0, 700, BLOCK + 3, 4 * BLOCK])
def test_sums_stop_at_the_ceiling(ctx: moderngl.Context, programs: Programs, place: int) -> None:
    counts = words(4 * BLOCK + 1)
    counts[place] = CEILING - 10
    offsets, sums = prefix_sums(ctx, programs, ctx.buffer(counts), len(counts))
    assert np.array_equal(np.frombuffer(offsets.read(), dtype=np.uint32), np.minimum(offsets_of(counts), CEILING))
    assert sums.read() == (CEILING, CEILING - 10)
