"""Every transparent fragment in the order of submission, for techniques whose result depends on it.

With `GL_ARB_fragment_shader_interlock` (`pixel_interlock_ordered`) a shader sees the fragments of a pixel in the order
in which their triangles were submitted. Here the same order comes without it: a fragment is captured with its rank,
the number of its triangle in the index buffer, and a pixel's run is sorted by rank. A triangle covers a pixel once,
so ranks differ inside a pixel, and what follows is identical from run to run and from driver to driver.
"""

from __future__ import annotations

from dataclasses import dataclass

import moderngl
import numpy as np
from numpy.typing import NDArray

from renderer.bands import row_bands
from renderer.csr import offsets_of, sort_fragments
from renderer.frame import Clock, Frame
from renderer.screen import read_linear
from renderer.techniques.bands import in_bands, rows_of
from renderer.techniques.base import Rendered
from renderer.techniques.sbuffer import capture_band
from renderer.techniques.skips import frame_skips
from schemas.limits import LIMITS
from schemas.problem import Problem

MAX_NODES = 16
"""Nodes a pixel that the compositing shaders hold in registers. Compilers unroll loops over them; else they would count
as turns (`renderer.screen.TURNS`)."""

_CAPTURED_BYTES = 12
"""Packed colour, depth and rank."""
_WORD_BYTES = 4
"""Colours and depths are two buffers for the resolve."""
_PIXEL_BYTES = 12 + 4
"""n, z_min, z_max of the count pass; the cursor while capturing, the offsets after it."""


@dataclass(frozen=True, slots=True)
class Ordered:
    """All transparent fragments of a view; those of a pixel in the order of submission.

    Attributes:
        offsets: int64 [P+1]; fragments of pixel p are `offsets[p]:offsets[p+1]`.
        packed: uint32 [N], `r | g << 8 | b << 16 | a << 24`, RGB gamma-2 encoded, straight alpha.
        depth: float32 [N], view-space distance along the view axis, metres.
        rank: uint32 [N], number of the triangle, ascending inside a pixel.
        passes: Milliseconds of each pass.
    """

    offsets: NDArray[np.int64]
    packed: NDArray[np.uint32]
    depth: NDArray[np.float32]
    rank: NDArray[np.uint32]
    passes: dict[str, float]


def capture_ordered(frame: Frame) -> Ordered:
    """Every transparent fragment of a frame, in the order of submission.

    Raises:
        Problem: One row has more fragments than a storage buffer holds.
    """
    offsets = offsets_of(frame.count())
    pool = np.empty((int(offsets[-1]), 3), dtype=np.uint32)
    clock = Clock(frame.ctx)
    with clock.measure("capture"):
        for band in row_bands(offsets, frame.width, LIMITS.buffer_bytes // _CAPTURED_BYTES):
            capture_band(frame, "ordered/capture.frag", offsets, band, pool, ranked=True)
    with clock.measure("sort"):
        keys = pool[:, 2].astype(np.uint64) << np.uint64(32) | np.arange(len(pool), dtype=np.uint64)
        sort_fragments(offsets, keys)
        order = (keys & np.uint64(0xFFFFFFFF)).astype(np.uint32)
        packed, depth = pool[order, 0], pool[order, 1].view(np.float32)
    rank = (keys >> np.uint64(32)).astype(np.uint32)
    return Ordered(offsets, packed, depth, rank, {**frame.passes("opaque", "count"), **clock.passes})


def check_nodes(technique: str, nodes: int, least: int) -> int:
    """The nodes themselves, if the technique can work with them.

    Args:
        technique: Its name.
        nodes: Nodes a pixel.
        least: Fewest with which it works.

    Raises:
        Problem: They are out of range.
    """
    if not least <= nodes <= MAX_NODES:
        raise Problem(
            f"{technique} cannot work with {nodes} nodes a pixel.", f"Ask for {least} up to {MAX_NODES} nodes."
        )
    return nodes


def render_ordered(frame: Frame, technique: str, nodes: int) -> Rendered:
    """Capture in the order of submission, then composite each pixel's run with a fixed number of nodes.

    Args:
        frame: The view.
        technique: Its name: `<technique>/resolve.frag` composites, with NODES defined.
        nodes: Nodes a pixel, see `check_nodes`.

    Returns:
        The picture. `pool_bytes` are those of the captured fragments of the whole window; above the limit of a storage
        buffer, bands of rows use one part of that size after the other.

    Raises:
        Problem: A pixel has more fragments than a shader can loop over, or one row more than a storage buffer holds.
    """
    ordered = capture_ordered(frame)
    clock = Clock(frame.ctx)

    def store(first: int, rows: int) -> list[moderngl.Buffer]:
        with clock.measure("upload"):
            return _upload(frame, ordered, first * frame.width, (first + rows) * frame.width)

    ends = rows_of(ordered.offsets, frame)
    image = in_bands(frame, clock, ends, _WORD_BYTES, store, f"{technique}/resolve.frag", defines={"NODES": nodes})
    k = np.minimum(np.diff(ordered.offsets), nodes).astype(np.int32)
    return Rendered(
        linear=read_linear(frame, image),
        k=k,
        passes={**ordered.passes, **clock.passes},
        captured=int(k.sum(dtype=np.int64)),
        pool_bytes=_CAPTURED_BYTES * len(ordered.packed),
        pixel_bytes=_PIXEL_BYTES,
        skips=frame_skips(frame),
    )


def _upload(frame: Frame, ordered: Ordered, begin: int, end: int) -> list[moderngl.Buffer]:
    """The runs of pixels begin..end - 1, bound; offsets count from the first of them."""
    offsets = ordered.offsets[begin : end + 1]
    run = slice(int(offsets[0]), int(offsets[-1]))
    words = (offsets - offsets[0]).astype(np.uint32), ordered.depth[run], ordered.packed[run]
    buffers = [frame.ctx.buffer(array if len(array) else np.zeros(1, np.uint32)) for array in words]
    for binding, buffer in enumerate(buffers):
        buffer.bind_to_storage_buffer(binding)
    return buffers
