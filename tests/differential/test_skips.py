"""What is skipped changes nothing: each picture again by the longer way, bit for bit."""

from __future__ import annotations

from typing import Any

import moderngl
import numpy as np
import pytest
from support.scenes import SIZE, VIEW, shells

from renderer.frame import Frame
from renderer.gpu_scene import GpuScene
from renderer.techniques import TECHNIQUES, Budget, KBufferOptimal, technique
from renderer.techniques.skips import EMPTY_TILES, TAIL
from renderer.tiles import Tiles, tiles_of
from schemas.fragments import FragmentDump

COUNTING = [
    name
    for name, entry in TECHNIQUES.items()
    if not entry.needs_bundle and name not in ("kbuffer-optimal", "weighted-average", "stochastic")
]


@pytest.fixture(scope="module")
def odd(gl: moderngl.Context) -> Frame:
    """A window that is no whole number of tiles, many of them empty."""
    return Frame(GpuScene(gl, shells()), VIEW, SIZE[0] + 5, SIZE[1] - 3)


@pytest.mark.parametrize("name", COUNTING)
def test_empty_tiles_are_the_background(odd: Frame, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    odd.count()
    tiled = technique(name).render(odd, Budget(3 * odd.pixels))
    assert tiled.skips[EMPTY_TILES] > 10
    for module in ("frame", "techniques.bands", "techniques.peeling"):
        monkeypatch.setattr(f"renderer.{module}.tiles_of", without_empty_tiles)
    again = Frame(odd.gpu, VIEW, odd.width, odd.height)
    again.count()
    whole = technique(name).render(again, Budget(3 * odd.pixels))
    assert whole.skips[EMPTY_TILES] == 0
    assert np.array_equal(tiled.linear, whole.linear)


def without_empty_tiles(*args: Any) -> Tiles:
    """Every tile is drawn as if it had a fragment."""
    tiles = tiles_of(*args)
    tiles.most.write(np.maximum(np.frombuffer(tiles.most.read(), dtype=np.uint32), 1))
    return tiles


def test_pixels_that_need_no_tail_are_the_same_with_one(frame: Frame, dump: FragmentDump) -> None:
    n = dump.counts.astype(np.int32)
    fullest = int(np.argmax(n))
    less = n.copy()
    less[fullest] -= 1
    without, with_tail = (KBufferOptimal(lambda *_, k=k: k).render(frame, Budget(0)) for k in (n, less))
    assert (without.skips[TAIL], with_tail.skips[TAIL]) == (1, 0)
    differs = (without.linear != with_tail.linear).any(axis=2).ravel()
    assert not np.delete(differs, fullest).any()
