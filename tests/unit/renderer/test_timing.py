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
from renderer.timing import READBACK, readback, recording, shared_clock, timers_are_right


@pytest.fixture(scope="module")
def gpu(gl: moderngl.Context) -> GpuScene:
    return GpuScene(gl, shells())


def test_a_recording_has_every_pass_of_a_frame_and_the_readbacks_apart(gpu: GpuScene, ctx: moderngl.Context) -> None:
    with recording(ctx) as found:
        rendered = KBufferImportance().render(Frame(gpu, VIEW, *SIZE), Budget(SIZE[0] * SIZE[1]))
    assert set(found.passes) == {*rendered.passes, READBACK}
    for name, milliseconds in rendered.passes.items():
        # The count and the importance map read back.
        assert 0.0 <= found.passes[name] <= milliseconds
    assert found.passes["importance"] < rendered.passes["importance"]
    assert found.milliseconds == pytest.approx(sum(found.passes.values()))
    assert found.milliseconds > rendered.milliseconds - 1e-6, "the picture's readback is beside the passes"


def test_a_readback_is_taken_from_the_pass_around_it(ctx: moderngl.Context) -> None:
    with recording(ctx) as found, Clock(ctx).measure("pass"):
        time.sleep(0.002)
        with readback(ctx):
            time.sleep(0.02)
    assert found.passes[READBACK] >= 20.0
    assert 2.0 <= found.passes["pass"] < 20.0


def test_a_recording_by_processor_time_does_not_count_what_the_machine_does_for_others(ctx: moderngl.Context) -> None:
    with recording(ctx, time.process_time) as found, Clock(ctx).measure("pass"):
        time.sleep(0.05)
        with readback(ctx):
            time.sleep(0.05)
    assert 0.0 <= found.passes["pass"] < 25.0
    assert 0.0 <= found.passes[READBACK] < 25.0


def test_a_software_driver_is_timed_by_the_processors(ctx: moderngl.Context) -> None:
    is_software = ctx.info["GL_RENDERER"].startswith(("llvmpipe", "softpipe"))
    assert shared_clock(ctx) is (time.process_time if is_software else time.perf_counter)


def test_nobody_listens_after_the_recording(ctx: moderngl.Context) -> None:
    with recording(ctx) as found:
        pass
    with Clock(ctx).measure("later"), readback(ctx):
        pass
    assert found.passes == {}


def test_a_pass_within_a_pass_does_not_nest_queries(ctx: moderngl.Context, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(timing, "timers_are_right", lambda _: True)
    clock = Clock(ctx)
    with recording(ctx) as found, clock.measure("outer"), clock.measure("inner"):
        pass
    assert set(found.gpu) == {"outer"}
    assert set(found.passes) == {"outer", "inner"}


def test_gpu_times_are_there_exactly_where_they_are_right(gpu: GpuScene, ctx: moderngl.Context) -> None:
    with recording(ctx) as found:
        Frame(gpu, VIEW, *SIZE)
    assert set(found.gpu) == ({"opaque"} if timers_are_right(ctx) else set())


def test_the_timers_of_llvmpipe_are_not_right(ctx: moderngl.Context) -> None:
    if not ctx.info["GL_RENDERER"].startswith("llvmpipe"):
        pytest.skip("another driver")
    assert not timers_are_right(ctx)
