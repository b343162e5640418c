"""Exclusive prefix sums of words on the GPU: from the fragments of every pixel to where its run of a pool begins.

Three compute passes: sums of blocks, a scan over them, offsets. They read and write P words twice and once. Sums stop
at 2^32 - 1. `renderer.csr.offsets_of` is the same in numpy.
"""

from __future__ import annotations

from dataclasses import dataclass

import moderngl
import numpy as np

from renderer.gpu_scene import set_uniforms
from renderer.programs import Programs

BLOCK = 4096
"""Words of a work group."""
CEILING = 2**32 - 1
"""Where sums stop."""

_COUNTS, _OFFSETS, _SUMS = range(3)
"""Storage bindings of `prefix/*.comp`."""


@dataclass(frozen=True, slots=True)
class Totals:
    """Sums of words on the GPU.

    Attributes:
        sums: uint32 [B+1, 2], of the B blocks; the last row is the sum of all words and the greatest of them.
    """

    sums: moderngl.Buffer

    def read(self) -> tuple[int, int]:
        """The sum of all words and the greatest of them: 8 bytes are read back."""
        total, most = np.frombuffer(self.sums.read(8, offset=self.sums.size - 8), dtype=np.uint32)
        return int(total), int(most)


def totals(ctx: moderngl.Context, programs: Programs, counts: moderngl.Buffer, items: int) -> Totals:
    """The sum of some words and the greatest of them.

    Args:
        ctx: The context.
        programs: Of the context.
        counts: uint32 [P] or longer.
        items: P.
    """
    blocks = _blocks(items)
    sums = ctx.buffer(reserve=8 * (blocks + 1))
    buffers = {_COUNTS: counts, _SUMS: sums}
    _run(ctx, programs, "blocks", blocks, items, buffers)
    _run(ctx, programs, "scan", 1, items, buffers)
    return Totals(sums)


def prefix_sums(
    ctx: moderngl.Context,
    programs: Programs,
    counts: moderngl.Buffer,
    items: int,
    into: moderngl.Buffer | None = None,
) -> tuple[moderngl.Buffer, Totals]:
    """Exclusive prefix sums of some words.

    Args:
        ctx: The context.
        programs: Of the context.
        counts: uint32 [P] or longer.
        items: P.
        into: uint32 [P+1] that gets the offsets, `counts` itself if it has that many words; None: a new buffer.

    Returns:
        Offsets uint32 [P+1], the sum of the words before each and of all; and the totals.
    """
    found = totals(ctx, programs, counts, items)
    offsets = ctx.buffer(reserve=4 * (items + 1)) if into is None else into
    buffers = {_COUNTS: counts, _OFFSETS: offsets, _SUMS: found.sums}
    _run(ctx, programs, "offsets", _blocks(items), items, buffers)
    return offsets, found


def _blocks(items: int) -> int:
    return items // BLOCK + 1  # of P + 1 offsets


def _run(
    ctx: moderngl.Context, programs: Programs, name: str, groups: int, items: int, buffers: dict[int, moderngl.Buffer]
) -> None:
    for binding, buffer in buffers.items():
        buffer.bind_to_storage_buffer(binding)
    program = programs.compute(f"prefix/{name}.comp", {"BLOCK": BLOCK})
    set_uniforms(program, {"items": items, "blocks": _blocks(items)})
    program.run(groups)
    ctx.memory_barrier()
