"""`binned` in the frame against the labeller's picture with no core, and what it needs."""

from __future__ import annotations

import moderngl
import numpy as np
import pytest
from support.scenes import SIZE, VIEW, shells

from labeller.curves import composite
from renderer.capture import capture
from renderer.frame import Frame
from renderer.gpu_scene import GpuScene
from renderer.techniques import Budget
from renderer.techniques.binned import Binned
from schemas.fragments import FragmentDump
from schemas.tail import BINNED_TAILS, TAILS, TailName


@pytest.mark.parametrize("tail", BINNED_TAILS)
@pytest.mark.parametrize("size", [SIZE, (61, 45), (1, 1)], ids=str)
def test_it_looks_as_simulated_without_a_core(gl: moderngl.Context, tail: TailName, size: tuple[int, int]) -> None:
    frame = Frame(GpuScene(gl, shells()), VIEW, *size, float_sums=True)
    dump = capture(frame).dump
    rendered = Binned(tail).render(frame, Budget(10**6))
    assert not rendered.k.any()
    simulated = composite(dump, rendered.k, tail).reshape(rendered.linear.shape)
    np.testing.assert_allclose(rendered.linear, simulated, atol=1e-5, rtol=0)


@pytest.mark.parametrize("tail", BINNED_TAILS)
def test_half_floats_change_less_than_a_display_shows(gl: moderngl.Context, tail: TailName) -> None:
    gpu = GpuScene(gl, shells())
    half, full = (
        Binned(tail).render(Frame(gpu, VIEW, *SIZE, float_sums=floats), Budget(0)).linear for floats in (False, True)
    )
    apart = np.abs(half - full)
    assert 0.0 < apart.max() < 2e-3
    assert np.square(apart).mean() < 2e-8


def test_it_draws_the_geometry_twice_beside_the_ranges_and_has_neither_pool_nor_atomics(
    gl: moderngl.Context, monkeypatch: pytest.MonkeyPatch
) -> None:
    gpu = GpuScene(gl, shells())
    frame = Frame(gpu, VIEW, *SIZE)
    drawn: list[str] = []
    draw = gpu.draw
    monkeypatch.setattr(gpu, "draw", lambda shader, *a, **k: (drawn.append(shader), draw(shader, *a, **k))[1])
    rendered = Binned().render(frame, Budget(0))
    assert drawn == ["range/range.frag", "gather/bins.frag", "binned/tail.frag"]
    assert (rendered.pool_bytes, rendered.captured) == (0, 0)


@pytest.mark.parametrize("tail", BINNED_TAILS)
def test_its_bytes_follow_from_the_row_of_its_tail(frame: Frame, tail: TailName) -> None:
    row, rendered = TAILS[tail], Binned(tail).render(frame, Budget(0))
    assert rendered.early_bytes == 0
    assert rendered.pixel_bytes == row.gathered_bytes + row.sum_bytes


def test_a_picture_is_identical_from_run_to_run(gl: moderngl.Context, dump: FragmentDump) -> None:
    one, two = (Binned().render(Frame(GpuScene(gl, shells()), VIEW, *SIZE), Budget(0)) for _ in range(2))
    assert np.array_equal(one.linear, two.linear)
    assert dump.total > 0
