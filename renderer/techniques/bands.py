"""What the exact techniques share: counts on the GPU, bands of rows that fit a storage buffer, passes over pixels."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from renderer.bands import row_bands
from renderer.frame import Clock, Frame
from renderer.gpu_scene import run_for, set_uniforms
from renderer.prefix import prefix_sums, totals
from renderer.programs import Defines
from renderer.screen import TURNS, resolve_screen
from renderer.tiles import Tiles, tiles_of
from schemas.limits import LIMITS
from schemas.problem import ExitCode, Problem

MOST_FRAGMENTS = TURNS // 3
"""Of one pixel: one level of the lists' merge sort takes up to 2.5 turns a fragment."""

Store = Callable[["Part"], list[moderngl.Buffer]]
"""Renders some rows into bound buffers, which it returns: they are released once resolved."""


@dataclass(frozen=True, slots=True)
class Counted:
    """n of every pixel, on the GPU.

    Attributes:
        counts: uint32 [P+1], the last one 0.
        tiles: By their fullest pixel.
    """

    counts: moderngl.Buffer
    tiles: Tiles


@dataclass(frozen=True, slots=True)
class Part:
    """Some rows of a window, and what a buffer holds of them.

    Attributes:
        first: The first row.
        rows: How many.
        base: Items of the rows before.
        items: Items of these.
    """

    first: int
    rows: int
    base: int
    items: int


def count_pixels(frame: Frame, clock: Clock) -> Counted:
    """The pass `count`, without the depth range that `Frame.depth_range` finds beside it."""
    with clock.measure("count"):
        return counted_pixels(frame)


def counted_pixels(frame: Frame) -> Counted:
    """Counts of every pixel, in no pass: for the statistics of a technique that keeps none."""
    counts = frame.buffer(frame.pixels + 1, 0)
    counts.bind_to_storage_buffer(0)
    frame.draw_transparent("count/count.frag", frame.target([]), {"RANGE": 0})
    frame.ctx.memory_barrier()
    return Counted(counts, tiles_of(frame.ctx, frame.gpu.programs, counts, frame.width, frame.height))


def count_totals(frame: Frame, clock: Clock, counts: moderngl.Buffer) -> tuple[int, int]:
    """N and max(n): two words that a pool's size and the number of dispatches depend on."""
    with clock.measure("count"):
        return totals(frame.ctx, frame.gpu.programs, counts, frame.pixels).read()


def read_counts(frame: Frame, counts: moderngl.Buffer) -> NDArray[np.int32]:
    """int32 [P], n(p) from a buffer: a statistic, for after a frame."""
    return np.frombuffer(counts.read(4 * frame.pixels), dtype=np.int32)


def offsets_from(frame: Frame, counts: moderngl.Buffer) -> moderngl.Buffer:
    """uint32 [P+1], where each pixel's fragments would begin in a pool."""
    return prefix_sums(frame.ctx, frame.gpu.programs, counts, frame.pixels)[0]


def parts_of(frame: Frame, total: int, item_bytes: int, offsets: Callable[[], moderngl.Buffer]) -> list[Part]:
    """As few bands of rows as fit a storage buffer.

    Args:
        frame: The view.
        total: Items of the window.
        item_bytes: Bytes of one.
        offsets: uint32 [P+1], items before each pixel. Where one buffer cannot hold all, its rows' ends are read back.

    Raises:
        Problem: One row alone does not fit.
    """
    capacity = LIMITS.buffer_bytes // item_bytes
    if total <= capacity:
        return [Part(0, frame.height, 0, total)]
    ends = np.frombuffer(offsets().read_chunks(4, 0, 4 * frame.width, frame.height + 1), dtype=np.uint32)
    return _parts(ends.astype(np.int64), capacity)


def equal_parts(frame: Frame, items: int, item_bytes: int) -> list[Part]:
    """`parts_of` where every pixel has the same number of items."""
    ends = np.arange(frame.height + 1, dtype=np.int64) * (frame.width * items)
    return _parts(ends, LIMITS.buffer_bytes // item_bytes) or [Part(0, frame.height, 0, 0)]


def _parts(ends: NDArray[np.int64], capacity: int) -> list[Part]:
    bands = row_bands(ends, 1, capacity)
    return [Part(first, rows, int(ends[first]), int(ends[first + rows] - ends[first])) for first, rows in bands]


def check_most(most: int) -> None:
    """Raises Problem if a pixel has too many fragments for a shader that visits each of them a few times."""
    if most > MOST_FRAGMENTS:
        raise Problem(
            f"A pixel has {most:,} transparent fragments; this technique can order {MOST_FRAGMENTS:,}.",
            "Use sbuffer.",
            ExitCode.LIMIT,
        )


def in_bands(
    frame: Frame,
    clock: Clock,
    tiles: Tiles,
    parts: list[Part],
    store: Store,
    resolve: str,
    defines: Defines | None = None,
    **uniforms: object,
) -> moderngl.Texture:
    """Store and resolve the window, one band of rows after the other.

    Args:
        frame: The view.
        clock: Gets the pass `resolve`.
        tiles: Of the window.
        parts: The bands.
        store: Stores a band.
        resolve: Fragment shader, as for `resolve_screen`; it reads what `store` has bound, and has `first_row` and
            `base`.
        defines: For the shader.
        uniforms: For the shader.

    Returns:
        RGBA32F, linear.
    """
    image = frame.ctx.texture((frame.width, frame.height), 4, dtype="f4")
    for part in parts:
        buffers = store(part)
        with clock.measure("resolve"):
            band = (image, part.first, part.rows)
            given: dict[str, Any] = {"first_row": part.first, "base": part.base, **uniforms}
            resolve_screen(frame, resolve, [frame.background], defines, band, tiles, **given)
        for buffer in buffers:
            buffer.release()
    return image


def over_pixels(frame: Frame, shader: str, pixels: int, defines: Defines | None = None, **uniforms: object) -> None:
    """Run a compute shader on some pixels.

    Args:
        frame: The view.
        shader: File of 64 invocations a group, run as `run_for` does, with the uniform `pixels`.
        pixels: How many.
        defines: For the shader.
        uniforms: For the shader.
    """
    program = frame.gpu.programs.compute(shader, defines)
    set_uniforms(program, {"pixels": pixels, **uniforms})
    run_for(program, pixels)
    frame.ctx.memory_barrier()
