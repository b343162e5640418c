"""Prefix sums on the GPU against numpy: the same words, in place or not, at every size around a block."""

from __future__ import annotations

import moderngl
import numpy as np
import pytest
from numpy.typing import NDArray

from renderer.csr import offsets_of
from renderer.prefix import BLOCK, CEILING, Prefix, prefix_sums
from renderer.programs import Programs

SIZES = [1, 2, 255, 257, BLOCK - 1, BLOCK, BLOCK + 1, 9 * BLOCK + 777, 300 * BLOCK - 1]


@pytest.fixture(scope="module")
def programs(gl: moderngl.Context) -> Programs:
    return Programs(gl)


def words(items: int) -> NDArray[np.uint32]:
    rng = np.random.default_rng(items)
    return np.where(rng.random(items) < 0.01, 5000, rng.integers(0, 9, items)).astype(np.uint32)


def found(prefix: Prefix) -> NDArray[np.uint32]:
    return np.frombuffer(prefix.offsets.read(), dtype=np.uint32)


@pytest.mark.parametrize("items", SIZES)
def test_offsets_and_totals_equal_numpys__items(ctx: moderngl.Context, programs: Programs, items: int) -> None:
    counts = words(items)
    prefix = prefix_sums(ctx, programs, ctx.buffer(counts), items)
    assert np.array_equal(found(prefix), offsets_of(counts))
    assert prefix.read_totals() == (counts.sum(), counts.max())


@pytest.mark.parametrize("items", SIZES)
def test_in_place_they_are_the_same__items(ctx: moderngl.Context, programs: Programs, items: int) -> None:
    counts = words(items)
    longer = ctx.buffer(np.append(counts, np.uint32(77)))  # what is there before does not matter
    prefix = prefix_sums(ctx, programs, longer, items, into=longer)
    assert prefix.offsets is longer
    assert np.array_equal(found(prefix), offsets_of(counts))


def test_a_longer_buffer_is_summed_to_its_items(ctx: moderngl.Context, programs: Programs) -> None:
    counts = words(5000)
    prefix = prefix_sums(ctx, programs, ctx.buffer(counts), 3000)
    assert np.array_equal(found(prefix), offsets_of(counts[:3000]))
    assert prefix.read_totals() == (counts[:3000].sum(), counts[:3000].max())


@pytest.mark.parametrize("place", [0, 700, BLOCK + 3, 4 * BLOCK])
def test_sums_stop_at_the_ceiling(ctx: moderngl.Context, programs: Programs, place: int) -> None:
    counts = words(4 * BLOCK + 1)
    counts[place] = CEILING - 10
    prefix = prefix_sums(ctx, programs, ctx.buffer(counts), len(counts))
    assert np.array_equal(found(prefix), np.minimum(offsets_of(counts), CEILING))
    assert prefix.read_totals() == (CEILING, CEILING - 10)
