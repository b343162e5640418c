"""What exact techniques need, foretold from counts, against what they report for the frames that they rendered."""

from __future__ import annotations

from dataclasses import replace

import moderngl
import numpy as np
import pytest
from support.scenes import SIZE, VIEW, shells

from renderer import exact_bytes as module
from renderer.exact_bytes import exact_bytes, fits
from renderer.frame import Frame
from renderer.gpu_scene import GpuScene
from renderer.techniques import TECHNIQUES, Budget, technique
from schemas.limits import LIMITS

EXACT = [name for name, entry in TECHNIQUES.items() if entry.family == "exact"]


@pytest.mark.parametrize("name", EXACT)
def test_every_exact_technique_takes_what_its_counts_say(ctx: moderngl.Context, name: str) -> None:
    frame = Frame(GpuScene(ctx, shells()), VIEW, *SIZE)
    rendered = technique(name).render(frame, Budget(1))
    needed = exact_bytes(name, frame.count())
    assert needed is not None
    assert (needed.pool, needed.pixel) == (rendered.pool_bytes, rendered.pixel_bytes)
    assert needed.total == rendered.total_bytes


def test_the_fullest_pixel_decides_for_arrays_and_all_fragments_for_lists() -> None:
    even, uneven = np.full(100, 3), np.append(np.zeros(99, int), 300)
    array, lists = (exact_bytes("abuffer-array", n) for n in (even, uneven)), exact_bytes("abuffer-list", uneven)
    assert [each.pool for each in array if each] == [8 * 3 * 100, 8 * 300 * 100]
    assert lists is not None
    assert lists.pool == 12 * 300


def test_nothing_is_needed_where_nothing_is_transparent() -> None:
    assert all(needed.pool == 0 for name in EXACT if (needed := exact_bytes(name, np.zeros(12, np.uint32))))


@pytest.mark.parametrize("name", [name for name in TECHNIQUES if name not in EXACT])
def test_other_techniques_have_a_budget_instead(name: str) -> None:
    assert exact_bytes(name, np.ones(4, np.uint32)) is None


def test_a_pool_fits_up_to_one_storage_buffer(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "LIMITS", replace(LIMITS, buffer_bytes=1000))
    assert [fits(1000), fits(1001)] == [True, False]
