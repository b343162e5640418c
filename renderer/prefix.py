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

BLOCK = 2048
"""Words of a work group."""
CEILING = 2**32 - 1
"""Where sums stop."""

_COUNTS, _OFFSETS, _SUMS = range(3)
"""Storage bindings of `prefix/*.comp`."""


@dataclass(frozen=True, slots=True)
class Prefix:
    """Prefix sums on the GPU.

    Attributes:
        offsets: uint32 [P+1]: the sum of the words before each, and of all.
        sums: uint32 [B+1, 2], of the B blocks; the last row is the sum of all words and the greatest of them.
    """

    offsets: moderngl.Buffer
    sums: moderngl.Buffer

    def read_totals(self) -> tuple[int, int]:
        """The sum of all words and the greatest of them: 8 bytes are read back."""
        total, most = np.frombuffer(self.sums.read(8, offset=self.sums.size - 8), dtype=np.uint32)
        return int(total), int(most)


def prefix_sums(
    ctx: moderngl.Context,
    programs: Programs,
    counts: moderngl.Buffer,
    items: int,
    into: moderngl.Buffer | None = None,
) -> Prefix:
    """Exclusive prefix sums of some words.

    Args:
        ctx: The context.
        programs: Of the context.
        counts: uint32 [P] or longer.
        items: P.
        into: uint32 [P+1] that gets the offsets, `counts` itself if it has that many words; None: a new buffer.
    """
    blocks = items // BLOCK + 1  # of P + 1 offsets
    offsets = ctx.buffer(reserve=4 * (items + 1)) if into is None else into
    sums = ctx.buffer(reserve=8 * (blocks + 1))
    for name, groups in (("blocks", blocks), ("scan", 1), ("offsets", blocks)):
        for binding, buffer in ((_COUNTS, counts), (_OFFSETS, offsets), (_SUMS, sums)):
            buffer.bind_to_storage_buffer(binding)
        program = programs.compute(f"prefix/{name}.comp", {"BLOCK": BLOCK})
        set_uniforms(program, {"items": items, "blocks": blocks})
        program.run(groups)
        ctx.memory_barrier()
    return Prefix(offsets, sums)
