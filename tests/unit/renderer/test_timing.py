"""Recordings: passes as clocks have them, readbacks apart, GPU timers only where they are right."""

from __future__ import annotations

import time

import moderngl
import pytest
from support.scenes import SIZE, VIEW, shells

from renderer import timing
from renderer.frame import Clock, Frame
from renderer.gpu_scene import GpuScene
from renderer.techniques import Budget, KBufferImportance
from renderer.timing import READBACK, readback, recording, timers_are_right


@pytest.fixture(scope="module")
def gpu(gl: moderngl.Context) -> GpuScene:
    return GpuScene(gl, shells())


def test_a_recording_has_every_pass_of_a_frame_and_the_readbacks_apart(gpu: GpuScene, ctx: moderngl.Context) -> None:
    with recording(ctx) as found:
        rendered = KBufferImportance().render(Frame(gpu, VIEW, *SIZE), Budget(SIZE[0] * SIZE[1]))
    assert set(found.host) == {*rendered.passes, READBACK}
    for name, milliseconds in rendered.passes.items():
        # The count and the importance map read back.
        assert 0.0 <= found.host[name] <= milliseconds
    assert found.host["importance"] < rendered.passes["importance"]
    assert found.milliseconds == pytest.approx(sum(found.host.values()))
    assert found.milliseconds > rendered.milliseconds - 1e-6, "the picture's readback is beside the passes"


def test_a_readback_is_taken_from_the_pass_around_it(ctx: moderngl.Context) -> None:
    with recording(ctx) as found, Clock(ctx).measure("pass"):
        time.sleep(0.002)
        with readback(ctx):
            time.sleep(0.02)
    assert found.host[READBACK] >= 20.0
    assert 2.0 <= found.host["pass"] < 20.0


def test_nobody_listens_after_the_recording(ctx: moderngl.Context) -> None:
    with recording(ctx) as found:
        pass
    with Clock(ctx).measure("later"), readback(ctx):
        pass
    assert found.host == {}


def test_a_pass_within_a_pass_does_not_nest_queries(ctx: moderngl.Context, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(timing, "timers_are_right", lambda _: True)
    clock = Clock(ctx)
    with recording(ctx) as found, clock.measure("outer"), clock.measure("inner"):
        pass
    assert set(found.gpu) == {"outer"}
    assert set(found.host) == {"outer", "inner"}


def test_gpu_times_are_there_exactly_where_they_are_right(gpu: GpuScene, ctx: moderngl.Context) -> None:
    with recording(ctx) as found:
        Frame(gpu, VIEW, *SIZE)
    assert set(found.gpu) == ({"opaque"} if timers_are_right(ctx) else set())


def test_the_timers_of_llvmpipe_are_not_right(ctx: moderngl.Context) -> None:
    if not ctx.info["GL_RENDERER"].startswith("llvmpipe"):
        pytest.skip("another driver")
    assert not timers_are_right(ctx)
