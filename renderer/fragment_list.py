"""The unordered list that a capture appends to: storage kept between views, since fresh pages cost as much as writing.

A scene's first view may be guessed too short; the list then grows, and the next views find it long enough.
"""

from __future__ import annotations

import moderngl
import numpy as np
from numpy.typing import NDArray

from renderer.csr import new_scratch
from schemas.limits import LIMITS

KEY_BYTES, PLACE_BYTES = 8, 4
"""Bytes of an appended fragment: RGBA8 and a float depth; pixel and facing."""
CAPACITY = LIMITS.buffer_bytes // KEY_BYTES
"""Most fragments of a list."""
SEGMENTS = 16
"""Parts of a list with a cursor each."""
CURSOR_WORDS = 16
"""Words from one cursor to the next: a cache line."""


class FragmentList:
    """Storage buffers of a context, and the arrays that they are read into.

    Args:
        ctx: The context.

    Attributes:
        capacity: Fragments that fit, over all segments.
        scratch: For `bin_fragments`.
    """

    def __init__(self, ctx: moderngl.Context) -> None:
        self._ctx = ctx
        self._cursors = ctx.buffer(reserve=4 * CURSOR_WORDS * SEGMENTS)
        self._buffers: tuple[moderngl.Buffer, ...] = ()
        self._keys, self._places = np.empty(0, dtype=np.uint64), np.empty(0, dtype=np.uint32)
        self.scratch = new_scratch(0)
        self.capacity = 0

    @property
    def bytes(self) -> int:
        """Bytes of the storage buffers."""
        return self.capacity * (KEY_BYTES + PLACE_BYTES)

    def reserve(self, fragments: int) -> None:
        """See to it that this many fragments fit, at most `CAPACITY`."""
        wanted = min(max(fragments, 1024), CAPACITY)
        if wanted <= self.capacity:
            return
        for buffer in self._buffers:
            buffer.release()
        self._buffers = self._ctx.buffer(reserve=KEY_BYTES * wanted), self._ctx.buffer(reserve=PLACE_BYTES * wanted)
        self._keys, self._places = np.empty(wanted, dtype=np.uint64), np.empty(wanted, dtype=np.uint32)
        self.scratch = new_scratch(wanted)
        self.capacity = wanted

    def begin(self) -> None:
        """Empty the list and bind cursors, keys and places to the storage bindings 0, 1, 2."""
        self._cursors.clear()
        for binding, buffer in enumerate((self._cursors, *self._buffers)):
            buffer.bind_to_storage_buffer(binding)

    def counts(self, segments: int) -> NDArray[np.int64]:
        """int64 [segments], fragments that were appended to each, also those that did not fit."""
        words = np.frombuffer(self._cursors.read(), dtype=np.uint32)
        return words[: segments * CURSOR_WORDS : CURSOR_WORDS].astype(np.int64)

    def read(self, counts: NDArray[np.int64]) -> tuple[NDArray[np.uint64], NDArray[np.uint32]]:
        """Keys uint64 and places uint32 of all fragments, segment by segment; overwritten by the next read.

        Args:
            counts: int64 [segments], as `counts` says; all of them fit.
        """
        ends, room = np.cumsum(counts), self.capacity // len(counts)
        for segment, (count, end) in enumerate(zip(counts.tolist(), ends.tolist(), strict=True)):
            if count:
                for buffer, part, size in (
                    (self._buffers[0], self._keys[end - count : end].view(np.uint8), KEY_BYTES),
                    (self._buffers[1], self._places[end - count : end].view(np.uint8), PLACE_BYTES),
                ):
                    buffer.read_into(part, size=len(part), offset=size * segment * room)
        return self._keys[: int(ends[-1])], self._places[: int(ends[-1])]
