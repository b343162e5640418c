"""The k+-buffer's rule, on counts that can be worked out by hand and on any others."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from renderer.allocation.dynamic import dynamic

N = np.array([0, 0, 1, 2, 5, 9])


@pytest.mark.parametrize(
    ("budget", "k"),
    [
        (0, [0, 0, 0, 0, 0, 0]),
        (3, [0, 0, 0, 0, 0, 0]),
        (4, [0, 0, 1, 1, 1, 1]),
        (8, [0, 0, 1, 2, 2, 2]),
        (9, [0, 0, 1, 2, 3, 3]),
        (10, [0, 0, 1, 2, 3, 3]),
        (16, [0, 0, 1, 2, 5, 8]),
        (17, N.tolist()),
        (1000, N.tolist()),
    ],
)
def test_only_fragments_that_are_there_are_paid_for(budget: int, k: list[int]) -> None:
    assert dynamic(N, budget).tolist() == k


def test_a_frame_without_fragments_has_nothing_to_keep() -> None:
    assert dynamic(np.zeros(5, np.uint32), 7).tolist() == [0] * 5


@given(st.lists(st.integers(0, 40), min_size=1, max_size=30), st.integers(0, 900))
def test_the_next_k_would_not_fit(counts: list[int], budget: int) -> None:
    n = np.array(counts, dtype=np.uint32)
    k = dynamic(n, budget)
    level = int(k.max())
    assert np.array_equal(k, np.minimum(level, n))
    assert k.sum() <= budget
    assert np.array_equal(k, n) or np.minimum(level + 1, n).sum() > budget
