"""The k(p) nearest fragments of every pixel by the lock-free two-pass chain, the tail, and the resolve.

All hybrid techniques are this with another k(p). The pool is one run of slots a pixel (an S-buffer), so that a budget
is used as allotted.
"""

from __future__ import annotations

import moderngl
import numpy as np
from numpy.typing import NDArray

from renderer.csr import offsets_of
from renderer.frame import Clock, Frame, Gather
from renderer.gpu_scene import set_uniforms
from renderer.techniques.base import Budget, Rendered
from schemas.tail import MAX_EXPONENT, TailName

SLOT_BYTES = 8
"""Depth and packed colour."""

_EMPTY = 0xFFFFFFFF
_TAIL_CODES: dict[TailName, int] = {"exact-coverage": 0, "density": 1, "weighted-average": 2, "paper": 3}
_NO_TAIL = -1

# Storage bindings of kbuffer/*.frag.
_OFFSETS, _DEPTHS, _COLOURS, _Z_MIN, _Z_MAX = range(5)


def render_chain(
    frame: Frame,
    slots: NDArray[np.integer],
    n: NDArray[np.integer],
    budget: Budget,
    gathered: Gather | None = None,
) -> Rendered:
    """Capture the nearest fragments into given slots, add the tail, resolve.

    Args:
        frame: The view.
        slots: int [P], slots a pixel gets; may exceed n(p), then some stay empty.
        n: int [P], fragments of each pixel.
        budget: Tail and its constant; `sum slots` is not checked against it here.
        gathered: What the technique has gathered to choose its slots, if anything.

    Returns:
        The picture; passes in order, memory as allocated.
    """
    if gathered is None and budget.tail == "density":
        gathered = "gather-tail"
    sums = None if gathered is None else frame.gather(gathered).sums[0]
    needed = ["count"] if gathered is None else ["count", gathered]
    clock = Clock(frame.ctx)
    image, pool_bytes = _passes(frame, clock, slots, budget, sums)
    k = np.minimum(slots, n).astype(np.int32)
    return Rendered(
        linear=image,
        k=k,
        passes={**frame.passes("opaque", *needed), **clock.passes},
        captured=int(k.sum(dtype=np.int64)),
        pool_bytes=pool_bytes,
        total_bytes=pool_bytes + frame.pixels * _bytes_a_pixel(needed),
    )


def _bytes_a_pixel(needed: list[str]) -> int:
    """Offsets and the tail's two targets, and what the passes before left alive."""
    live = {"count": 12, "gather-tail": 16, "gather-nearest": 16 + 8, "gather": 5 * 16 + 8}
    return 4 + 2 * 16 + sum(live.get(name, 0) for name in needed)


def _passes(
    frame: Frame, clock: Clock, slots: NDArray[np.integer], budget: Budget, sums: moderngl.Texture | None
) -> tuple[NDArray[np.float32], int]:
    with clock.measure("prefix"):
        offsets = offsets_of(slots)
        total = int(offsets[-1])
        offset_buffer = frame.ctx.buffer(offsets.astype(np.uint32))
        depths, colours = frame.buffer(total, _EMPTY), frame.buffer(total, _EMPTY)
    for binding, buffer in ((_OFFSETS, offset_buffer), (_DEPTHS, depths), (_COLOURS, colours)):
        buffer.bind_to_storage_buffer(binding)
    with clock.measure("chain-depth"):
        frame.draw_transparent("kbuffer/chain_depth.frag", frame.target([]))
        frame.ctx.memory_barrier()
    with clock.measure("chain-colour"):
        tails = _chain_colour(frame, budget, sums)
    with clock.measure("resolve"):
        target = resolve(frame, _TAIL_CODES[budget.tail], tails)
    image = read_linear(frame, target)
    return image, SLOT_BYTES * total


def _chain_colour(frame: Frame, budget: Budget, sums: moderngl.Texture | None) -> list[moderngl.Texture]:
    tails = [frame.ctx.texture((frame.width, frame.height), 4, dtype="f4") for _ in range(2)]
    target = frame.target(tails)
    for tail in tails:
        frame.ctx.framebuffer([tail]).clear(0.0, 0.0, 0.0, 0.0)
    if sums is not None:
        _, z_min, z_max = frame.depth_range()
        z_min.bind_to_storage_buffer(_Z_MIN)
        z_max.bind_to_storage_buffer(_Z_MAX)
        sums.use(0)
    defines = {"TAIL": _TAIL_CODES[budget.tail], "MAX_EXPONENT": MAX_EXPONENT}
    frame.draw_transparent("kbuffer/chain_colour.frag", target, defines, gathered=0, density_g=budget.g)
    frame.ctx.memory_barrier()
    return tails


def resolve(frame: Frame, tail_code: int, tails: list[moderngl.Texture]) -> moderngl.Texture:
    """Composite the bound pool (offsets, colours) over the tail and the background; RGBA32F, linear."""
    image = frame.ctx.texture((frame.width, frame.height), 4, dtype="f4")
    program = frame.gpu.programs.get("common/fullscreen.vert", "kbuffer/resolve.frag", {"TAIL": tail_code})
    set_uniforms(program, {"width": frame.width, "background": 0, "tail_colour": 1, "tail_opacity": 2})
    for unit, texture in enumerate([frame.background, *tails]):
        texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        texture.use(unit)
    frame.ctx.framebuffer([image]).use()
    frame.ctx.enable_only(moderngl.NOTHING)
    frame.ctx.vertex_array(program, []).render(moderngl.TRIANGLES, vertices=3)
    return image


def resolve_all(frame: Frame, offsets: NDArray[np.int64], packed: NDArray[np.uint32]) -> NDArray[np.float32]:
    """Composite a sorted pool that holds every fragment: no tail.

    Args:
        frame: The view.
        offsets: int64 [P+1].
        packed: uint32 [N], front to back inside a pixel.

    Returns:
        float32 [H, W, 3], linear.
    """
    offset_buffer = frame.ctx.buffer(offsets.astype(np.uint32))  # named, or it would be freed before it is read
    offset_buffer.bind_to_storage_buffer(_OFFSETS)
    pool = frame.buffer(len(packed), _EMPTY)
    if len(packed):
        pool.write(np.ascontiguousarray(packed))
    pool.bind_to_storage_buffer(_COLOURS)
    return read_linear(frame, resolve(frame, _NO_TAIL, []))


def read_linear(frame: Frame, image: moderngl.Texture) -> NDArray[np.float32]:
    """An RGBA32F texture as float32 [H, W, 3]."""
    rgba = np.frombuffer(image.read(), dtype=np.float32).reshape(frame.height, frame.width, 4)
    return np.ascontiguousarray(rgba[:, :, :3])
