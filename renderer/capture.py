"""The A-buffer dump of a view: count, prefix sum, capture into an exact-size CSR pool, sort (DESIGN: capture)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from renderer.csr import offsets_of, sort_fragments
from renderer.frame import Clock, Frame
from schemas.fragments import FragmentDump
from schemas.limits import LIMITS
from schemas.problem import ExitCode, Problem

_BYTES = 8
"""Bytes of a captured fragment: RGBA8 and a float depth."""
_BYTES_A_BAND = LIMITS.buffer_bytes


@dataclass(frozen=True, slots=True)
class Captured:
    """A dump and what it cost.

    Attributes:
        dump: Every transparent fragment, sorted.
        passes: Milliseconds of each pass.
        bands: Bands of rows the capture was split into, so that each fits a storage buffer.
    """

    dump: FragmentDump
    passes: dict[str, float]
    bands: int


def capture(frame: Frame) -> Captured:
    """Every transparent fragment of a frame.

    Args:
        frame: The view, its opaque pass done.

    Returns:
        The dump; identical from run to run and for any number of bands.

    Raises:
        Problem: More fragments than the limits allow.
    """
    counts = frame.count()
    offsets = offsets_of(counts)
    total = int(offsets[-1])
    if total > LIMITS.fragments:
        raise Problem(
            f"View '{frame.view.name}' has {total:,} transparent fragments; the limit is {LIMITS.fragments:,}.",
            "Ask for a smaller --size or another view.",
            ExitCode.LIMIT,
        )
    facing = _facing(frame)
    keys = np.empty(total, dtype=np.uint64)
    bands = row_bands(offsets, frame.width, _BYTES_A_BAND // _BYTES)
    clock = Clock(frame.ctx)
    with clock.measure("capture"):
        for first, rows in bands:
            _capture_band(frame, offsets, first, rows, keys)
    with clock.measure("sort"):
        sort_fragments(offsets, keys)
    dump = FragmentDump(
        width=frame.width,
        height=frame.height,
        offsets=offsets,
        rgba=(keys & np.uint64(0xFFFFFFFF)).astype("<u4").view(np.uint8).reshape(-1, 4),
        depth=(keys >> np.uint64(32)).astype("<u4").view(np.float32),
        background=_background(frame),
        facing=facing,
    )
    return Captured(dump, {**frame.passes("opaque", "count"), **clock.passes}, len(bands))


def row_bands(offsets: NDArray[np.int64], width: int, capacity: int) -> list[tuple[int, int]]:
    """Split rows into bands of at most `capacity` fragments.

    Args:
        offsets: int64 [P+1].
        width: Pixels per row.
        capacity: Fragments that a storage buffer holds.

    Returns:
        First row and number of rows of every band that has fragments.

    Raises:
        Problem: One row alone has more.
    """
    ends = offsets[::width]
    bands: list[tuple[int, int]] = []
    row, rows = 0, len(ends) - 1
    while row < rows:
        until = int(np.searchsorted(ends, ends[row] + capacity, side="right")) - 1
        if until <= row:
            raise Problem(
                f"Row {row} alone has more than {capacity:,} transparent fragments.",
                "Ask for a smaller --size.",
                ExitCode.LIMIT,
            )
        until = min(until, rows)
        if ends[until] > ends[row]:
            bands.append((row, until - row))
        row = until
    return bands


def _capture_band(frame: Frame, offsets: NDArray[np.int64], first: int, rows: int, keys: NDArray[np.uint64]) -> None:
    begin, end = first * frame.width, (first + rows) * frame.width
    base, stop = int(offsets[begin]), int(offsets[end])
    cursor = frame.ctx.buffer((offsets[begin:end] - base).astype(np.uint32))
    pool = frame.ctx.buffer(reserve=_BYTES * (stop - base))
    cursor.bind_to_storage_buffer(0)
    pool.bind_to_storage_buffer(1)
    frame.draw_transparent("capture/capture.frag", frame.target([]), scissor=(first, rows), first_row=first)
    frame.ctx.memory_barrier()
    pool.read_into(keys.view(np.uint8)[_BYTES * base : _BYTES * stop])
    cursor.release()
    pool.release()


def _background(frame: Frame) -> NDArray[np.uint8]:
    rgba = np.frombuffer(frame.background.read(), dtype=np.uint8).reshape(-1, 4)
    return np.ascontiguousarray(rgba[:, :3])


def _facing(frame: Frame) -> NDArray[np.uint8]:
    gathered = frame.gather("gather-nearest")
    assert gathered.nearest_facing is not None, "this gather has the nearest fragment"
    return np.frombuffer(gathered.nearest_facing.read(4 * frame.pixels), dtype=np.uint32).astype(np.uint8)
