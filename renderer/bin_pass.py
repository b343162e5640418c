"""The additive pass that fills a binned tail's depth bins, and what a predictor reads beside them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import moderngl

from renderer.gpu_scene import run_for, set_uniforms
from schemas.tail import TAILS, Tail, TailName

if TYPE_CHECKING:
    from renderer.frame import Frame

RANGE, COUNTS = 7, 6
"""Storage bindings of tile ranges and counts by bin, in every shader."""
KEPT_UNIT = 3
"""First of the texture units of what is kept of the bins, in every shader."""
TARGETS = 8
"""Of one pass, at most: what every GL has."""
_COLOUR_BYTES = 8
"""Of a texture of four half floats."""


@dataclass(slots=True)
class Binned:
    """What one additive pass leaves of a frame for a binned tail.

    Attributes:
        name: Name of the tail.
        tail: Its row.
        kept: RGBA16 [H, W], one for each four bins: 16 bits a bin, as `shaders/common/kept_bins.glsl` says.
        ranges: uint32 [T, 2], between which depths the bins of a tile's pixels lie, float bits.
        counts: uint32 [P, bins / 4], fragments of each bin, 8 bits each, 255 for that many or more; None: not counted.
        colours: RGBA16F [H, W], sums of colours as `shaders/gather/bins.frag` says; none, or two.
    """

    name: TailName
    tail: Tail
    kept: list[moderngl.Texture]
    ranges: moderngl.Buffer
    counts: moderngl.Buffer | None
    colours: list[moderngl.Texture]

    @property
    def kept_bytes(self) -> int:
        """Bytes a pixel of what is kept, counts and colours included; ranges are an eighth of a byte."""
        return self.tail.kept_bytes + self._beside

    @property
    def gathered_bytes(self) -> int:
        """Bytes a pixel while it is gathered."""
        return self.tail.gathered_bytes + self._beside

    @property
    def _beside(self) -> int:
        counted = 0 if self.counts is None else self.tail.bins
        return counted + _COLOUR_BYTES * len(self.colours)

    def bind(self) -> None:
        """Bind what the tail reads: tile ranges, and the bins from unit `KEPT_UNIT` on."""
        self.ranges.bind_to_storage_buffer(RANGE)
        for unit, texture in enumerate(self.kept, KEPT_UNIT):
            texture.use(unit)


def gather_bins(frame: Frame, name: TailName, *, colours: bool = False, counts: bool = False) -> Binned:
    """Fill the depth bins of every pixel, and pack them in their place.

    Where colours do not fit into the targets beside 16 bins and their means, they are a pass of their own.

    Args:
        frame: The view.
        name: A tail with bins.
        colours: Whether sums of colours are gathered too.
        counts: Whether the fragments of each bin are counted too.
    """
    tail, ranges = TAILS[name], frame.tile_range()
    bins = frame.targets(tail.bins // 4, "nu2")
    means = frame.targets(tail.bins // 4, "nu2") if tail.mean_levels else []
    sums = frame.targets(2, "f2") if colours else []
    counted = frame.buffer(frame.pixels * tail.bins // 4, 0) if counts else None
    ranges.bind_to_storage_buffer(RANGE)
    if counted is not None:
        counted.bind_to_storage_buffer(COUNTS)
    fits = len(bins) + len(means) + len(sums) <= TARGETS
    for targets, alone in [(bins + means + sums, 0)] if fits else [(bins + means, 0), (sums, 1)]:
        defines = {
            **tail.defines,
            "ALONE": alone,
            "COLOURS": int(colours and (fits or alone)),
            "COUNTS": int(counts and not alone),
        }
        frame.draw_transparent("gather/bins.frag", frame.target(targets), defines)
    frame.ctx.memory_barrier()
    frame.target([]).use()  # a context keeps alive what is bound: the targets, long after the last use of them
    _pack(frame, tail, bins, means)
    return Binned(name, tail, bins, ranges, counted, sums)


def _pack(frame: Frame, tail: Tail, bins: list[moderngl.Texture], means: list[moderngl.Texture]) -> None:
    program = frame.gpu.programs.compute("gather/pack.comp", tail.defines)
    for unit, texture in enumerate(bins):
        texture.bind_to_image(unit, read=True, write=True)
    for unit, texture in enumerate(means):
        texture.use(unit)
    set_uniforms(program, {"width": frame.width, "pixels": frame.pixels})
    run_for(program, frame.pixels)
    frame.ctx.memory_barrier()
