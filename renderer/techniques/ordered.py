"""Every transparent fragment in the order of submission, for techniques whose result depends on it.

With `GL_ARB_fragment_shader_interlock` (`pixel_interlock_ordered`) a shader sees the fragments of a pixel in the order
in which their triangles were submitted. Here the same order comes without it: a fragment is captured with its rank,
the number of its triangle in the index buffer, and a pixel's run is sorted by rank, on the GPU. A triangle covers a
pixel once, so ranks differ inside a pixel, and what follows is identical from run to run and from driver to driver.
"""

from __future__ import annotations

from dataclasses import dataclass

import moderngl
import numpy as np
from numpy.typing import NDArray

from renderer.csr import offsets_of
from renderer.frame import Clock, Frame
from renderer.screen import read_linear
from renderer.techniques.arrivals import Arrivals
from renderer.techniques.bands import Part, check_most, in_bands
from renderer.techniques.base import Rendered
from renderer.techniques.runs import PIXEL_BYTES, Runs
from renderer.techniques.skips import frame_skips
from schemas.problem import Problem

MAX_NODES = 16
"""Nodes a pixel that the compositing shaders hold in registers. Compilers unroll loops over them; else they would count
as turns (`renderer.screen.TURNS`)."""

NODE_BYTES = 8
"""Of a node in both papers: RGBA8 and a depth, or a depth and a transmittance."""

_WORDS = 3
"""Packed colour, depth and rank."""


@dataclass(frozen=True, slots=True)
class EnginePool:
    """The one pool of a frame from which an engine takes the nodes of all lists; what does not fit is lost.

    Attributes:
        slots: Nodes a pixel on average: `slots * W * H` in all.
        pixel_bytes: Bytes a pixel that the engine takes, for nodes and heads.
    """

    slots: int
    pixel_bytes: int


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
    """Every transparent fragment of a frame, in the order of submission, read back: what the shaders composite.

    Raises:
        Problem: One row has more fragments than a storage buffer holds.
    """
    clock = Clock(frame.ctx)
    runs = Runs(frame, clock, _WORDS)
    words = np.empty((runs.total, _WORDS), dtype=np.uint32)
    for part in runs.parts():
        pool = runs.capture(part)
        runs.sort(part)
        pool.read_into(words[part.base :], size=4 * _WORDS * part.items)
        pool.release()
    packed, depth, rank = (np.ascontiguousarray(words[:, i]) for i in range(_WORDS))
    offsets = offsets_of(runs.read_counts())
    return Ordered(offsets, packed, depth.view(np.float32), rank, {**frame.passes("opaque"), **clock.passes})


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
            f"{technique} cannot work with {nodes} nodes per pixel.", f"Ask for {least} up to {MAX_NODES} nodes."
        )
    return nodes


def render_ordered(frame: Frame, technique: str, nodes: int, engine: EnginePool | None = None) -> Rendered:
    """Capture in the order of submission, then composite each pixel's run with a fixed number of nodes.

    Args:
        frame: The view.
        technique: Its name: `<technique>/resolve.frag` composites, with NODES defined.
        nodes: Nodes a pixel, see `check_nodes`.
        engine: The pool whose overflow is lost; None: every fragment is composited.

    Returns:
        The picture. `pool_bytes` are those of the captured fragments of the whole window; above the limit of a storage
        buffer, bands of rows use one part of that size after the other. `node_bytes` are what the technique would hold
        instead with interlock, or what the engine takes.

    Raises:
        Problem: A pixel has more fragments than a shader can loop over, or one row more than a storage buffer holds.
    """
    clock = Clock(frame.ctx)
    runs = Runs(frame, clock, _WORDS)
    check_most(runs.most)
    slots = frame.pixels * engine.slots if engine else 0
    arrivals = Arrivals(frame, clock, slots) if engine and runs.total > slots else None

    def store(part: Part) -> list[moderngl.Buffer]:
        pool = runs.capture(part)
        runs.sort(part)
        if arrivals:
            arrivals.bind()
        return [pool]

    defines = {"NODES": nodes, "WORDS": _WORDS, "FULL": int(arrivals is not None)}
    image = in_bands(frame, clock, runs.tiles, runs.parts(), store, f"{technique}/resolve.frag", defines, slots=slots)
    linear = read_linear(frame, image)
    k = np.minimum(runs.read_counts(), nodes).astype(np.int32)
    return Rendered(
        linear=linear,
        k=k,
        passes={**frame.passes("opaque"), **clock.passes},
        captured=int(k.sum(dtype=np.int64)),
        pool_bytes=runs.pool_bytes + (arrivals.nbytes if arrivals else 0),
        pixel_bytes=PIXEL_BYTES,
        node_bytes=engine.pixel_bytes if engine else NODE_BYTES * nodes,
        skips=frame_skips(frame, runs.tiles),
    )
