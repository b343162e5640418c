"""Times of a frame in more detail than `Clock` has it: readbacks apart, and the GPU's own timers where they are right.

A `Recording` listens to every `Clock` of the process while it is open, by the host's clock or another one: a pass takes
what that clock says, less the readbacks within it.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cache

import moderngl

from renderer.context import describe, is_software

READBACK = "readback"
"""Name of the pass that holds the time of all readbacks."""

_PROBE = """#version 430
layout(local_size_x = 64) in;
layout(std430, binding = 0) buffer Out { uint values[]; };
uniform uint turns;
void main() {
    uint x = gl_GlobalInvocationID.x;
    for (uint i = 0u; i < turns; ++i) x = x * 1664525u + 1013904223u;
    values[gl_GlobalInvocationID.x] = x;
}
"""
_PROBE_GROUPS = 256
_PROBES = 3
_PROBE_SECONDS = 5e-3
"""Work of this length is far above what starting and awaiting it costs."""
_RIGHT = (0.5, 1.05)
"""Of the finished host clock: what a timer query may say of such work."""


@dataclass(slots=True)
class Recording:
    """What one or more frames took.

    Attributes:
        seconds: The clock.
        passes: Pass -> milliseconds from when all before it is finished to when it is, without readbacks; they are the
            pass `READBACK`.
        gpu: Pass -> milliseconds by timer queries; empty where they are not right.
    """

    seconds: Callable[[], float] = time.perf_counter
    passes: dict[str, float] = field(default_factory=dict)
    gpu: dict[str, float] = field(default_factory=dict)
    _query: moderngl.Query | None = None
    _open: list[str] = field(default_factory=list)

    @property
    def milliseconds(self) -> float:
        """Of all passes, readbacks included."""
        return sum(self.passes.values())


_recording: Recording | None = None


@contextmanager
def recording(ctx: moderngl.Context, seconds: Callable[[], float] = time.perf_counter) -> Iterator[Recording]:
    """Listen to all clocks until the context is left; one at a time."""
    global _recording
    made = Recording(seconds, _query=ctx.query(time=True) if timers_are_right(ctx) else None)
    _recording, before = made, _recording
    try:
        yield made
    finally:
        _recording = before


@contextmanager
def gpu_pass(name: str) -> Iterator[None]:
    """A pass for the GPU's timer, if somebody listens; queries do not nest, so a pass within a pass is part of it."""
    listening = _recording
    if listening is None:
        yield
        return
    query = None if listening._open else listening._query
    listening._open.append(name)
    try:
        if query is None:
            yield
        else:
            with query:
                yield
            listening.gpu[name] = listening.gpu.get(name, 0.0) + 1e-6 * query.elapsed
    finally:
        listening._open.pop()


def shared_clock(ctx: moderngl.Context) -> Callable[[], float]:
    """The clock that tells techniques apart on a machine that others use, too.

    A software driver's work is that of its threads: what the processors do for this process does not depend on who else
    keeps them busy. A GPU's is on the host's clock.
    """
    return time.process_time if is_software(describe(ctx)) else time.perf_counter


def now() -> float:
    """Seconds by the clock of who listens; 0 where nobody does."""
    return 0.0 if _recording is None else _recording.seconds()


def pass_over(name: str, milliseconds: float) -> None:
    """A pass is over that took so long by `now`, readbacks within it included."""
    if _recording is not None:
        _recording.passes[name] = _recording.passes.get(name, 0.0) + milliseconds


@contextmanager
def readback(ctx: moderngl.Context) -> Iterator[None]:
    """A block that does nothing but read from the GPU what it has finished, within a pass or outside."""
    listening = _recording
    if listening is None:
        yield
        return
    ctx.finish()
    start = listening.seconds()
    yield
    taken = 1e3 * (listening.seconds() - start)
    listening.passes[READBACK] = listening.passes.get(READBACK, 0.0) + taken
    if listening._open:
        within = listening._open[-1]
        listening.passes[within] = listening.passes.get(within, 0.0) - taken


@cache
def timers_are_right(ctx: moderngl.Context) -> bool:
    """Whether timer queries agree with the finished host clock, found by timing a compute shader both ways.

    Software drivers answer before the work is done, and say that it took nothing. A process that the system interrupts
    in between would be told the whole time all the same, so that several answers have to agree.
    """
    program = ctx.compute_shader(_PROBE)
    out = ctx.buffer(reserve=4 * 64 * _PROBE_GROUPS)
    out.bind_to_storage_buffer(0)
    query = ctx.query(time=True)

    def share(turns: int) -> tuple[float, float]:
        """Seconds of the host, and which part of them the query says."""
        program["turns"] = turns
        ctx.finish()
        start = time.perf_counter()
        with query:
            program.run(_PROBE_GROUPS)
        ctx.finish()
        host = time.perf_counter() - start
        return host, 1e-9 * query.elapsed / host

    turns = 512
    while share(turns)[0] < _PROBE_SECONDS and turns < 1 << 24:
        turns *= 2
    return all(_RIGHT[0] <= share(turns)[1] <= _RIGHT[1] for _ in range(_PROBES))
