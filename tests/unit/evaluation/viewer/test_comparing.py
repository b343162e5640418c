"""Comparisons beside the window: the numbers of this process, one picture at a time, and an end that is survived."""

from __future__ import annotations

import time
from collections.abc import Iterator

import numpy as np
import pytest
from support.dumps import random_dump

from evaluation.bench.exact import Exact
from evaluation.viewer.comparing import Compared, Comparer, Picture, compare
from labeller.curves import composite
from schemas.fragments import FragmentDump
from schemas.problem import Problem

SECONDS = 300.0
DUMP, OTHER = random_dump(24, 16, 6, seed=1), random_dump(24, 16, 6, seed=2)


def picture(dump: FragmentDump, most: int, perceptual: bool = False) -> Picture:
    """Of a fixed k."""
    k = np.minimum(dump.counts, most).astype(np.int32)
    return Picture(composite(dump, k).reshape(dump.height, dump.width, 3), k, perceptual)


def answer_of(comparer: Comparer) -> Compared | Problem:
    end = time.monotonic() + SECONDS
    while (found := comparer.answer()) is None:
        assert time.monotonic() < end
        time.sleep(0.02)
    return found


@pytest.fixture
def comparer() -> Iterator[Comparer]:
    found = Comparer()
    yield found
    found.close()


def test_a_picture_with_all_fragments_has_no_error() -> None:
    found = compare(Exact(DUMP), picture(DUMP, 6))
    assert (found.mse, found.psnr, found.flip) == (0.0, None, None)
    assert found.mse_display < 1e-14, "the rounding of float32"
    assert (found.fragments, found.k[1]) == (DUMP.total, DUMP.counts.max())


def test_another_process_finds_the_same_and_its_end_is_an_answer(comparer: Comparer) -> None:
    assert comparer.answer() is None, "nothing was asked"
    large = random_dump(300, 200, 30, seed=3)  # more than a pipe holds
    begun = time.monotonic()
    comparer.ask("large", large, picture(large, 1))
    assert comparer._process.is_alive()
    asking = time.monotonic() - begun
    answer_of(comparer)
    assert asking < 0.5 * (time.monotonic() - begun), "whoever asks does not wait until the process is there"
    # The second picture is of the view of the first, whose fragments are not sent again.
    for view, dump, most, perceptual in (("a", DUMP, 1, False), ("a", DUMP, 2, True), ("b", OTHER, 1, False)):
        asked = picture(dump, most, perceptual)
        comparer.ask(view, DUMP if view == "a" and most == 1 else OTHER, asked)
        with pytest.raises(RuntimeError, match="one picture"):
            comparer.ask(view, dump, asked)
        assert answer_of(comparer) == compare(Exact(dump), asked)
    comparer._process.kill()
    comparer._process.join()
    comparer.is_busy = True
    lost = answer_of(comparer)
    assert isinstance(lost, Problem)
    assert not comparer.is_busy
    comparer.ask("b", OTHER, picture(OTHER, 1))
    assert answer_of(comparer) == compare(Exact(OTHER), picture(OTHER, 1))
