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

import moderngl
import numpy as np
from numpy.typing import NDArray

from renderer.csr import offsets_of
from renderer.frame import BIN_DEFINES, Clock, Frame, Gathered
from renderer.programs import Defines
from renderer.screen import TURNS, read_linear, resolve_screen
from renderer.techniques.base import Budget, Rendered
from renderer.techniques.skips import PREDICTOR, TAIL, frame_skips
from schemas.limits import LIMITS
from schemas.problem import ExitCode, Problem
from schemas.tail import DENSITY_BINS, MAX_EXPONENT, TailName

SLOT_BYTES = 8
"""Depth and packed colour."""
RANGE_BYTES = 12
"""n and depth range of a pixel."""

_EXTENSIONS = frozenset({"GL_NV_shader_atomic_int64", "GL_ARB_gpu_shader_int64"})
_EMPTY = 0xFFFFFFFF
_TAIL_CODES: dict[TailName, int] = {"exact-coverage": 0, "density": 1, "weighted-average": 2, "paper": 3}
_BINNED = 4
_NO_TAIL = -1

# Storage bindings of kbuffer/*.frag; the slots of the one-pass chain are where the colours of the other are.
_OFFSETS, _DEPTHS, _COLOURS, _Z_MIN, _Z_MAX, _FRONT, _MEMORY = range(7)


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
class _Tail:
    """What the tail needs: its code in the shaders, the density tail's constant, where the optical depth lies.

    `memory` is where resolving notes what last core fragments change, if anywhere.
    """

    code: int
    g: float
    gathered: Gathered | None
    memory: Memory | None = None

    @property
    def defines(self) -> Defines:
        """Of the shaders."""
        bins = self.gathered.bins if self.code == _BINNED and self.gathered is not None else 0
        return {"TAIL": self.code, **({"BINS": bins, **BIN_DEFINES} if bins else {})}


def one_pass_available(ctx: moderngl.Context) -> bool:
    """Whether the driver has 64-bit atomics."""
    return ctx.extensions >= _EXTENSIONS


def render_chain(
    frame: Frame,
    slots: NDArray[np.integer],
    n: NDArray[np.integer],
    budget: Budget,
    gathered: Gathered | None = None,
    before: int = 0,
) -> Rendered:
    """Capture the nearest fragments into given slots, add the tail, resolve.

    Where every pixel has a slot for every fragment, there is no tail: none is gathered or blended.

    Args:
        frame: The view.
        slots: int [P], slots a pixel gets; may exceed n(p), then some stay empty.
        n: int [P], fragments of each pixel.
        budget: Tail, its constant, and the form of the chain; `sum slots` is not checked against it here.
        gathered: What the technique has gathered to choose its slots, if anything. It stays, whatever the tail reads.
        before: Bytes a pixel that the technique needed at once to choose them.

    Returns:
        The picture; passes in order, memory as allocated.

    Raises:
        Problem: The pool is larger than a storage buffer may be, or the driver lacks the form that was asked for.
    """
    complete = bool((slots >= n).all())
    own = gathered
    if not complete:
        gathered = gathered_for_tail(frame, budget, gathered)
    beside = 0 if own is None or own is gathered else own.pixel_bytes
    sums = [each.pass_bytes + (beside if each is gathered else 0) for each in (own, gathered) if each is not None]
    before = max(before, RANGE_BYTES + max(sums, default=0))
    needed = ["count"] if gathered is None else ["count", gathered.name]
    clock = Clock(frame.ctx)
    with clock.measure("prefix"):
        offsets = offsets_of(slots)
        offset_buffer = frame.ctx.buffer(offsets.astype(np.uint32))
    _check_turns(offsets)
    total = int(offsets[-1])
    image = draw_chain(frame, clock, offset_buffer, total, budget, gathered, complete=complete)
    k = np.minimum(slots, n).astype(np.int32)
    return Rendered(
        linear=read_linear(frame, image),
        k=k,
        passes={**frame.passes("opaque", *needed), **clock.passes},
        captured=int(k.sum(dtype=np.int64)),
        pool_bytes=SLOT_BYTES * total,
        pixel_bytes=chain_bytes(gathered, None if complete else budget.tail) + beside,
        early_bytes=before,
        skips={**frame_skips(frame), TAIL: int(complete)},
    )


def draw_chain(
    frame: Frame,
    clock: Clock,
    offsets: moderngl.Buffer,
    total: int,
    budget: Budget,
    gathered: Gathered | None,
    *,
    complete: bool,
    memory: Memory | None = None,
) -> moderngl.Texture:
    """The passes of the chain, from slots that are on the GPU to the picture.

    Args:
        frame: The view.
        clock: Gets the passes.
        offsets: uint32 [P+1], where each pixel's run of slots begins.
        total: Slots of the pool; at least the last offset.
        budget: As `render_chain` has it.
        gathered: What the tail needs, from `gathered_for_tail`.
        complete: Whether every fragment is known to have a slot: then there is no tail.
        memory: Where to note what each pixel's last core fragment changes; not with `complete`.

    Returns:
        RGBA32F, linear.

    Raises:
        Problem: As `render_chain` has it.
    """
    offsets.bind_to_storage_buffer(_OFFSETS)
    code = _BINNED if budget.tail in DENSITY_BINS else _TAIL_CODES[budget.tail]
    tail = _Tail(_NO_TAIL if complete else code, budget.g, gathered, memory)
    chain = _one_pass if _is_one_pass(frame.ctx, budget, total) else _two_pass
    return chain(frame, clock, total, tail)


def gathered_for_tail(frame: Frame, budget: Budget, gathered: Gathered | None) -> Gathered | None:
    """What a tail reads while fragments are captured: what is gathered already, if that serves it.

    Args:
        frame: The view.
        budget: Its tail.
        gathered: What the technique has gathered to choose its slots, if anything.
    """
    bins = DENSITY_BINS.get(budget.tail, 0)
    if bins:
        return gathered if gathered is not None and gathered.bins == bins else frame.gather("gather-tail", bins=bins)
    if budget.tail == "density" and (gathered is None or gathered.bins):
        return frame.gather("gather-tail")
    return gathered


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


def chain_bytes(gathered: Gathered | None, tail: TailName | None) -> int:
    """Bytes a pixel: offsets, n and depth range, the tail's targets if there is one, what the gather pass left."""
    targets = 0 if tail is None else 16 if tail in DENSITY_BINS else 2 * 16
    return 4 + RANGE_BYTES + targets + (0 if gathered is None else gathered.pixel_bytes)


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


def _one_pass(frame: Frame, clock: Clock, total: int, tail: _Tail) -> moderngl.Texture:
    with clock.measure("chain"):
        slots = frame.buffer(2 * total, _EMPTY)
        slots.bind_to_storage_buffer(_COLOURS)
        tails = _draw_with_tail(frame, "kbuffer/chain.frag", tail)
    with clock.measure("resolve"):
        return _resolve(frame, tail, tails, stride=2)


def _two_pass(frame: Frame, clock: Clock, total: int, tail: _Tail) -> moderngl.Texture:
    with clock.measure("chain-depth"):
        depths, colours = frame.buffer(total, _EMPTY), frame.buffer(total, _EMPTY)
        depths.bind_to_storage_buffer(_DEPTHS)
        colours.bind_to_storage_buffer(_COLOURS)
        frame.draw_transparent("kbuffer/chain_depth.frag", frame.target([]))
        frame.ctx.memory_barrier()
    with clock.measure("chain-colour"):
        tails = _draw_with_tail(frame, "kbuffer/chain_colour.frag", tail)
    with clock.measure("resolve"):
        return _resolve(frame, tail, tails, stride=1)


def _draw_with_tail(frame: Frame, fragment: str, tail: _Tail) -> list[moderngl.Texture]:
    """Draw into the bound slots; the targets that hold the tail's sums, or none."""
    tails: list[moderngl.Texture] = []
    if tail.code != _NO_TAIL:
        tails = frame.float_targets(*[4] * (1 if tail.code == _BINNED else 2))
        _, z_min, z_max = frame.depth_range()
        z_min.bind_to_storage_buffer(_Z_MIN)
        z_max.bind_to_storage_buffer(_Z_MAX)
        if tail.gathered is not None:
            tail.gathered.sums[0].use(0)
            if tail.gathered.front is not None:
                tail.gathered.front.bind_to_storage_buffer(_FRONT)
    defines = {**tail.defines, "MAX_EXPONENT": MAX_EXPONENT}
    frame.draw_transparent(fragment, frame.target(tails), defines, gathered=0, density_g=tail.g)
    frame.ctx.memory_barrier()
    return tails


def _resolve(frame: Frame, tail: _Tail, tails: list[moderngl.Texture], stride: int) -> moderngl.Texture:
    """Composite the bound pool (offsets, colours) over the tail and the background; RGBA32F, linear."""
    textures, defines = [frame.background, *tails], {**tail.defines, "STRIDE": stride}
    if tail.memory is None:
        return resolve_screen(frame, "kbuffer/resolve.frag", textures, defines, first_row=0)
    # What falls back into the tail is weighed as the chain weighs it.
    tail.memory.buffer.bind_to_storage_buffer(_MEMORY)
    if tail.gathered is not None:
        textures.append(tail.gathered.sums[0])
    defines |= {"OBSERVE": 1, "MAX_EXPONENT": MAX_EXPONENT, **tail.memory.defines}
    image = resolve_screen(
        frame, "kbuffer/resolve.frag", textures, defines, first_row=0, gathered=len(textures) - 1, density_g=tail.g
    )
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
