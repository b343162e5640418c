"""The A-buffer dump of a view: one pass appends every fragment to a list, a counting sort makes the CSR pool.

One geometry pass instead of count and capture (DESIGN: capture), because small triangles, not fragments, dominate. How
long the list gets is not known before: it is as long as the scene's views needed so far, and the pass is repeated
where that is too short.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from renderer.csr import bin_fragments, offsets_of
from renderer.fragment_list import CAPACITY, CURSOR_WORDS, SEGMENTS
from renderer.frame import Clock, Frame
from schemas.fragments import FragmentDump
from schemas.limits import LIMITS
from schemas.problem import ExitCode, Problem

Word = TypeVar("Word", bound=np.generic)

_PIXELS = 1 << 24
"""Most pixels of one band: the pixel shares a word with 8 bits of facing."""
_GUESS = 8
"""Fragments a pixel that the list of a scene's first view has room for."""


@dataclass(frozen=True, slots=True)
class Captured:
    """A dump and what it cost.

    Attributes:
        dump: Every transparent fragment, sorted.
        passes: Milliseconds of each pass.
        bands: Bands of rows the capture was split into, so that each fits a storage buffer.
        repeated: Passes whose list was too short; 0 for the usual view.
    """

    dump: FragmentDump
    passes: dict[str, float]
    bands: int
    repeated: int


def capture(frame: Frame) -> Captured:
    """Every transparent fragment of a frame.

    Args:
        frame: The view, its opaque pass done.

    Returns:
        The dump; identical from run to run, for any number of bands and threads.

    Raises:
        Problem: More fragments than the limits allow.
    """
    appender = _Appender(frame)
    rows = max(1, min(frame.height, _PIXELS // frame.width))
    bands = [band for row in range(0, frame.height, rows) for band in appender.rows(row, min(rows, frame.height - row))]
    with appender.clock.measure("readback"):
        background = _background(frame)
        tile_range = np.frombuffer(frame.tile_range().read(), dtype=np.float32).reshape(-1, 2)
    dump = FragmentDump(
        width=frame.width,
        height=frame.height,
        offsets=_joined_offsets([band.offsets for band in bands]),
        rgba=_joined([band.colour for band in bands]).view(np.uint8).reshape(-1, 4),
        depth=_joined([band.depth for band in bands]),
        background=background,
        facing=_joined([band.facing for band in bands]),
        tile_range=tile_range,
    )
    return Captured(dump, {**frame.passes("opaque", "range"), **appender.clock.passes}, len(bands), appender.repeated)


@dataclass(frozen=True, slots=True)
class _Band:
    offsets: NDArray[np.int64]
    colour: NDArray[np.uint32]
    depth: NDArray[np.float32]
    facing: NDArray[np.uint8]


class _Appender:
    """Captures bands of rows, with one list that grows when a band does not fit."""

    def __init__(self, frame: Frame) -> None:
        self.clock, self.repeated = Clock(frame.ctx), 0
        self._frame, self._total = frame, 0

    def rows(self, first: int, rows: int) -> list[_Band]:
        """The fragments of some rows, in one band if they fit."""
        fragments = self._frame.gpu.fragment_list
        fragments.reserve(_GUESS * rows * self._frame.width)
        counts = self._append(first, rows, SEGMENTS)
        # Where most is in few tiles, segments of one size would need far more room than there are fragments.
        segments = SEGMENTS if SEGMENTS * int(counts.max()) <= CAPACITY else 1
        needed = segments * int(counts.max()) if segments > 1 else int(counts.sum())
        if needed > fragments.capacity or segments < SEGMENTS:
            self.repeated += 1
            self._check(self._total + int(counts.sum()))
            if needed > CAPACITY:
                return self._halves(first, rows, needed)
            fragments.reserve(needed)
            counts = self._append(first, rows, segments)
        self._total += int(counts.sum())
        self._check(self._total)
        with self.clock.measure("readback"):
            keys, places = fragments.read(counts)
        with self.clock.measure("sort"):
            band = _Band(*bin_fragments(keys, places, rows * self._frame.width, fragments.scratch))
        return [band]

    def _halves(self, first: int, rows: int, count: int) -> list[_Band]:
        if rows == 1:
            raise Problem(
                f"Row {first} alone has {count:,} transparent fragments, more than {CAPACITY:,}.",
                "Ask for a smaller --size.",
                ExitCode.LIMIT,
            )
        return self.rows(first, rows // 2) + self.rows(first + rows // 2, rows - rows // 2)

    def _append(self, first: int, rows: int, segments: int) -> NDArray[np.int64]:
        """int64 [segments]: fragments of some rows; those that fit are in the list."""
        frame = self._frame
        fragments = frame.gpu.fragment_list
        with self.clock.measure("capture"):
            fragments.begin()
            frame.draw_transparent(
                "capture/append.frag",
                frame.target([]),
                {"CURSOR_WORDS": CURSOR_WORDS},
                scissor=(first, rows),
                first_row=first,
                segments=segments,
                capacity=fragments.capacity // segments,
            )
            frame.ctx.memory_barrier()
        return fragments.counts(segments)

    def _check(self, total: int) -> None:
        if total > LIMITS.fragments:
            raise Problem(
                f"View '{self._frame.view.name}' has {total:,} transparent fragments or more; "
                f"the limit is {LIMITS.fragments:,}.",
                "Ask for a smaller --size or another view.",
                ExitCode.LIMIT,
            )


def _joined(parts: list[NDArray[Word]]) -> NDArray[Word]:
    return parts[0] if len(parts) == 1 else np.concatenate(parts)


def _joined_offsets(parts: list[NDArray[np.int64]]) -> NDArray[np.int64]:
    return parts[0] if len(parts) == 1 else offsets_of(np.concatenate([np.diff(part) for part in parts]))


def _background(frame: Frame) -> NDArray[np.uint8]:
    rgba = np.frombuffer(frame.background.read(), dtype=np.uint8).reshape(-1, 4)
    rgb = np.empty((len(rgba), 3), dtype=np.uint8)
    for channel in range(3):  # five times as fast as a copy of the slice
        rgb[:, channel] = rgba[:, channel]
    return rgb
