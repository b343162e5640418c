"""The k(p) nearest fragments of every pixel by a lock-free chain of slots, the tail, and the resolve.

All hybrid techniques are this with another k(p). The pool is one run of slots a pixel (an S-buffer), so that a budget
is used as allotted.

Slots of a run are passed in order: each keeps the minimum of what passes it and hands the larger value on, so slot i
ends as the i-th smallest whatever the order of arrival. With 64-bit atomic minima on (depth, packed colour) that is one
pass, and what falls out of the last slot goes to the tail at once. Without, a first pass finds the depths, and a second
one the colours and the tail. The core is the same to the bit; the tail's sums are added in another order. Where a
driver shades fragments of one pixel at the same time, which of them carries an evicted one to the tail is not fixed, so
the last bits of the one-pass tail may differ from run to run there.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from renderer.bin_pass import Binned
from renderer.csr import offsets_of
from renderer.frame import Clock, Frame
from renderer.programs import Defines
from renderer.screen import TURNS, read_linear, resolve_screen
from renderer.techniques.base import Budget, Rendered
from renderer.techniques.skips import PREDICTOR, TAIL, frame_skips
from schemas.limits import LIMITS
from schemas.problem import ExitCode, Problem
from schemas.tail import DENSITY_G, MAX_EXPONENT, NO_TAIL, TAILS, Tail, TailKind

SLOT_BYTES = 8
"""Depth and packed colour."""
RANGE_BYTES = 12
"""n and depth range of a pixel."""
_DENSITY_UNIT = 3
"""Texture unit of what the density tail reads."""
OFFSET_BYTES = 4
"""Where a pixel's run of slots begins."""

_EXTENSIONS = frozenset({"GL_NV_shader_atomic_int64", "GL_ARB_gpu_shader_int64"})
_EMPTY = 0xFFFFFFFF

# Storage bindings of kbuffer/*.frag; the slots of the one-pass chain are where the colours of the other are.
_OFFSETS, _DEPTHS, _COLOURS, _Z_MIN, _Z_MAX, _, _MEMORY = range(7)


@dataclass(frozen=True, slots=True)
class Memory:
    """Where resolving notes what last core fragments change.

    Attributes:
        buffer: uint32 [P], see `shaders/kbuffer-temporal/memory.glsl`.
        defines: Of that file.
    """

    buffer: moderngl.Buffer
    defines: Defines


@dataclass(frozen=True, slots=True)
class TailInputs:
    """What a tail reads while fragments are captured.

    Attributes:
        tail: Its row; None: every fragment has a slot, and there is no tail.
        g: The density tail's constant.
        binned: The depth bins of a tail that has some.
        density: RGBA32F, of the density tail.
    """

    tail: Tail | None
    g: float = DENSITY_G
    binned: Binned | None = None
    density: moderngl.Texture | None = None

    @property
    def defines(self) -> Defines:
        """Of the shaders."""
        if self.tail is None:
            return {"TAIL": NO_TAIL}
        own = self.tail.defines if self.binned is None else self.binned.defines
        return {**own, "MAX_EXPONENT": MAX_EXPONENT}

    @property
    def passes(self) -> tuple[str, ...]:
        """The passes of the frame that made them."""
        if self.binned is not None:
            return "range", "bins"
        return () if self.density is None else ("gather",)

    @property
    def pixel_bytes(self) -> int:
        """Bytes a pixel beside the pool: of what is read, and of the tail's sums."""
        if self.tail is None:
            return 0
        return self.tail.gathered_bytes + (16 if self.density is not None else 0) + self.tail.sum_bytes

    def bind(self) -> dict[str, Any]:
        """Bind it; the uniforms of the shaders."""
        if self.density is not None:
            self.density.use(_DENSITY_UNIT)
        if self.binned is not None:
            self.binned.bind()
        return {"gathered": _DENSITY_UNIT, "density_g": self.g}


def tail_inputs(frame: Frame, budget: Budget, *, complete: bool = False) -> TailInputs:
    """Gather what a tail reads.

    Args:
        frame: The view.
        budget: Its tail.
        complete: Whether every fragment has a slot: then there is no tail.
    """
    if complete:
        return TailInputs(None)
    tail = TAILS[budget.tail]
    if tail.kind == TailKind.BINNED:
        return TailInputs(tail, budget.g, binned=frame.kept_bins(budget.tail))
    if tail.kind == TailKind.DENSITY:
        return TailInputs(tail, budget.g, density=frame.gather_density())
    return TailInputs(tail, budget.g)


def one_pass_available(ctx: moderngl.Context) -> bool:
    """Whether the driver has 64-bit atomics."""
    return ctx.extensions >= _EXTENSIONS


def render_chain(
    frame: Frame,
    slots: NDArray[np.integer],
    n: NDArray[np.integer],
    budget: Budget,
    before: int = 0,
) -> Rendered:
    """Capture the nearest fragments into given slots, add the tail, resolve.

    Where every pixel has a slot for every fragment, there is no tail: none is gathered or blended.

    Args:
        frame: The view.
        slots: int [P], slots a pixel gets; may exceed n(p), then some stay empty.
        n: int [P], fragments of each pixel.
        budget: Tail, its constant, and the form of the chain; `sum slots` is not checked against it here.
        before: Bytes a pixel that the technique needed at once to choose them, beside n and the depth range.

    Returns:
        The picture; passes in order, memory as allocated.

    Raises:
        Problem: The pool is larger than a storage buffer may be, or the driver lacks the form that was asked for.
    """
    complete = bool((slots >= n).all())
    inputs = tail_inputs(frame, budget, complete=complete)
    clock = Clock(frame.ctx)
    with clock.measure("prefix"):
        offsets = offsets_of(slots)
        offset_buffer = frame.ctx.buffer(offsets.astype(np.uint32))
    _check_turns(offsets)
    total = int(offsets[-1])
    offset_buffer.bind_to_storage_buffer(_OFFSETS)
    chain = _one_pass if _is_one_pass(frame.ctx, budget, total) else _two_pass
    image = chain(frame, clock, total, inputs)
    k = np.minimum(slots, n).astype(np.int32)
    return Rendered(
        linear=read_linear(frame, image),
        k=k,
        passes={**frame.passes("opaque", "count", *inputs.passes), **clock.passes},
        captured=int(k.sum(dtype=np.int64)),
        pool_bytes=SLOT_BYTES * total,
        pixel_bytes=OFFSET_BYTES + RANGE_BYTES + inputs.pixel_bytes,
        early_bytes=RANGE_BYTES + before,
        skips={**frame_skips(frame), TAIL: int(complete)},
    )


def render_complete(frame: Frame, n: NDArray[np.integer], budget: Budget) -> Rendered | None:
    """The exact picture where a budget holds every fragment, so that nothing has to choose slots; else None.

    Args:
        frame: The view.
        n: int [P], fragments of each pixel.
        budget: As `render_chain` has it.
    """
    if budget.fragments < int(n.sum(dtype=np.int64)):
        return None
    rendered = render_chain(frame, n, n, budget)
    return replace(rendered, skips={**rendered.skips, PREDICTOR: 1})


def _is_one_pass(ctx: moderngl.Context, budget: Budget, total: int) -> bool:
    available = one_pass_available(ctx)
    if budget.chain == "auto":
        # Its slots are one buffer, those of the two-pass chain are two of half the size.
        return available and SLOT_BYTES * total <= LIMITS.buffer_bytes
    if budget.chain == "one-pass" and not available:
        raise Problem(
            "This driver has no 64-bit atomics, which the one-pass chain needs.",
            "Use the two-pass chain: its core is the same.",
            ExitCode.USAGE,
        )
    return budget.chain == "one-pass"


def _one_pass(frame: Frame, clock: Clock, total: int, tail: TailInputs) -> moderngl.Texture:
    with clock.measure("chain"):
        slots = frame.buffer(2 * total, _EMPTY)
        slots.bind_to_storage_buffer(_COLOURS)
        tails = _draw_with_tail(frame, "kbuffer/chain.frag", tail)
    with clock.measure("resolve"):
        return resolve_slots(frame, tail, tails, stride=2)


def _two_pass(frame: Frame, clock: Clock, total: int, tail: TailInputs) -> moderngl.Texture:
    with clock.measure("chain-depth"):
        depths, colours = frame.buffer(total, _EMPTY), frame.buffer(total, _EMPTY)
        depths.bind_to_storage_buffer(_DEPTHS)
        colours.bind_to_storage_buffer(_COLOURS)
        frame.draw_transparent("kbuffer/chain_depth.frag", frame.target([]))
        frame.ctx.memory_barrier()
    with clock.measure("chain-colour"):
        tails = _draw_with_tail(frame, "kbuffer/chain_colour.frag", tail)
    with clock.measure("resolve"):
        return resolve_slots(frame, tail, tails, stride=1)


def _draw_with_tail(frame: Frame, fragment: str, tail: TailInputs) -> list[moderngl.Texture]:
    """Draw into the bound slots; the targets that hold the tail's sums, or none."""
    tails = tail_targets(frame, tail)
    if tail.density is not None:
        _, z_min, z_max = frame.depth_range()
        z_min.bind_to_storage_buffer(_Z_MIN)
        z_max.bind_to_storage_buffer(_Z_MAX)
    frame.draw_transparent(fragment, frame.target(tails), tail.defines, **tail.bind())
    frame.ctx.memory_barrier()
    return tails


def tail_targets(frame: Frame, tail: TailInputs) -> list[moderngl.Texture]:
    """Targets for a tail's sums, zero: weighted colour and weight, and its opacity; none without a tail.

    Behind bins, they are half floats and 16-bit whole numbers: half of the bytes, for less than a hundredth more error
    in all but clouds of thousands of cards.
    """
    if tail.tail is None:
        return []
    if tail.tail.bins:
        return frame.tail_sums()
    return frame.float_targets(4, 4)


def resolve_slots(
    frame: Frame,
    tail: TailInputs,
    tails: list[moderngl.Texture],
    stride: int,
    memory: Memory | None = None,
    ends: Defines | None = None,
) -> moderngl.Texture:
    """Composite the bound pool (offsets, colours) over the tail and the background; RGBA32F, linear.

    Args:
        frame: The view.
        tail: Of the tail.
        tails: Its sums, from `tail_targets`.
        stride: Words of a slot.
        memory: Where to note what each pixel's last core fragment changes; only with a tail.
        ends: Further defines of `kbuffer/resolve.frag`, where runs end elsewhere than at the next one's begin.
    """
    textures, defines = [frame.background, *tails], {**tail.defines, "STRIDE": stride, **(ends or {})}
    if memory is None:
        return resolve_screen(frame, "kbuffer/resolve.frag", textures, defines, first_row=0)
    # What falls back into the tail is weighed as it was when it was captured.
    memory.buffer.bind_to_storage_buffer(_MEMORY)
    defines |= {"OBSERVE": 1, **memory.defines}
    image = resolve_screen(frame, "kbuffer/resolve.frag", textures, defines, first_row=0, **tail.bind())
    frame.ctx.memory_barrier()
    return image


def _check_turns(offsets: NDArray[np.int64]) -> None:
    """Raises Problem if a pixel has more slots than one shader can visit."""
    most = int(np.diff(offsets).max(initial=0))
    if most > TURNS:
        raise Problem(
            f"A pixel has {most:,} fragments or slots; one shader can visit {TURNS:,}.",
            "Ask for a smaller budget or another view.",
            ExitCode.LIMIT,
        )
