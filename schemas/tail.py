"""The tails (METHOD.md section 2), one row each, their constants, and the error metrics (section 1)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum
from typing import Final, Literal, get_args

TailName = Literal[
    "binned-8", "binned-12", "binned-16", "density-16", "density", "exact-coverage", "weighted-average", "paper"
]
MetricName = Literal["display", "linear", "paper"]

METRICS: tuple[MetricName, ...] = get_args(MetricName)


class TailKind(IntEnum):
    """How a tail weighs its fragments and what it lets through: the number of it in every language."""

    EXACT_COVERAGE = 0
    DENSITY = 1
    WEIGHTED_AVERAGE = 2
    PAPER = 3
    BINNED = 4


@dataclass(frozen=True, slots=True)
class Tail:
    """One row of the table of tails.

    Attributes:
        kind: How it weighs.
        bins: Depth bins in which the optical depth of a pixel is gathered, a multiple of 4; 0: none.
        share_levels: Steps in which the share of the optical depth in front of a bin is kept, at most 255.
        mean_levels: Steps in which a bin's mean depth is kept, at most 255; 0: it is not, and taken to be the middle.
    """

    kind: TailKind
    bins: int = 0
    share_levels: int = 0
    mean_levels: int = 0

    @property
    def gathered_bytes(self) -> int:
        """Bytes a pixel of the bins while they are gathered: one word for each."""
        return self.bins * 4

    @property
    def kept_bytes(self) -> int:
        """Bytes a pixel of what is kept of them, in their place: 16 bits a bin."""
        return self.bins * 2

    @property
    def sum_bytes(self) -> int:
        """Bytes a pixel of the tail's sums."""
        return 10 if self.bins else 32

    @property
    def defines(self) -> dict[str, int | float]:
        """What a shader that knows tails is compiled with."""
        kinds: dict[str, int | float] = {f"TAIL_{kind.name}": int(kind) for kind in TailKind}
        if not self.bins:
            return {"TAIL": int(self.kind), **kinds}
        levels = {"BINS": self.bins, "SHARE_LEVELS": self.share_levels, "MEAN_LEVELS": self.mean_levels}
        return {"TAIL": int(self.kind), **kinds, **levels, **BIN_CONSTANTS}


TAILS: Final[Mapping[TailName, Tail]] = {
    "binned-8": Tail(TailKind.BINNED, 8, 255, 255),
    "binned-12": Tail(TailKind.BINNED, 12, 255, 255),
    "binned-16": Tail(TailKind.BINNED, 16, 255, 255),
    "density-16": Tail(TailKind.BINNED, 16, 15, 0),
    "density": Tail(TailKind.DENSITY),
    "exact-coverage": Tail(TailKind.EXACT_COVERAGE),
    "weighted-average": Tail(TailKind.WEIGHTED_AVERAGE),
    "paper": Tail(TailKind.PAPER),
}
"""Every tail, in the order in which lists show them."""

TAIL_NAMES: Final[tuple[TailName, ...]] = tuple(TAILS)
BINNED_TAILS: Final[tuple[TailName, ...]] = tuple(name for name, tail in TAILS.items() if tail.bins)
"""Those with depth bins, which a bundle can be made for: the core of a predicted allocation is whole bins."""

NO_TAIL: Final = -1
"""`TAIL` of shaders where every fragment has a slot."""

TAIL_HELP = f"One of {', '.join(TAILS)}."
"""For the help of a command's option."""

DEFAULT_TAIL: TailName = "binned-12"

MOST_BINS: Final = max(tail.bins for tail in TAILS.values())

DENSITY_G = 0.75
"""Default g of the density tail, `w_i = a_i exp(-g D x_i)`."""

OPTICAL_UNIT = 253
"""Depth bins count optical depth in so many units of 1, up to BIN_LIMIT: integers, so that a sum does not depend on the
order. No stored alpha's number of units is within .004 of a half, so that every logarithm rounds alike."""

BIN_LIMIT = 4095
"""Where a depth bin is full: 12 bits, an optical depth of 16, behind which nothing is visible."""

COUNT_LIMIT = 255
"""Fragments of a depth bin, or more: 8 bits."""

ROOT_SHARE = 0.6
PLAIN_SHARE = 0.4
"""Depth bins are equal in `y = PLAIN_SHARE x + ROOT_SHARE sqrt(x)`: finer in front, where more is visible.

Two numbers, each the float32 nearest to it: languages differ in what `1 - ROOT_SHARE` is."""

RANGE_TILE = 8
"""Side of the tiles, in pixels, whose nearest and farthest fragments the depth bins of their pixels lie between."""

MOST_OPACITY = 16.0
"""Where a binned tail's own optical depth stops: 16 bits, of which one unit is 1/4096; behind it nothing is visible."""

LEAST_OTHERS = 1e-3
"""Optical depth of a bin's other fragments below which their mean says nothing: they are taken to lie in the middle."""

LEAST_SPREAD = 1e-3
"""Half of the least length, in bins, that a bin's other fragments are spread over."""

LUMA: Final = (54, 183, 19)
"""Rec. 709 luma of a stored colour, in 256ths: one whole number from 0 to 255 stands for three."""

LUMA_SHIFT: Final = 6
"""A pixel's word of luma has the sum of units times luma in its higher half, less so many of its lowest bits,"""
LUMA_SQUARE_SHIFT: Final = 14
"""and of units times its square in its lower half, less so many. Both are rounded, and stop at 16 bits."""

BIN_CONSTANTS: Final[dict[str, int | float]] = {
    **{"ROOT_SHARE": ROOT_SHARE, "PLAIN_SHARE": PLAIN_SHARE, "OPTICAL_UNIT": OPTICAL_UNIT, "BIN_LIMIT": BIN_LIMIT},
    **{"COUNT_LIMIT": COUNT_LIMIT},
    **{
        "RANGE_TILE": RANGE_TILE,
        "MOST_OPACITY": MOST_OPACITY,
        "LEAST_OTHERS": LEAST_OTHERS,
        "LEAST_SPREAD": LEAST_SPREAD,
    },
    **dict(zip(("LUMA_R", "LUMA_G", "LUMA_B"), LUMA, strict=True)),
    **{"LUMA_SHIFT": LUMA_SHIFT, "LUMA_SQUARE_SHIFT": LUMA_SQUARE_SHIFT},
}
"""Those of `shaders/common/depth_bins.glsl` that all bins share."""

MAX_EXPONENT = 60.0
"""The exponent `g D x` is clamped here, so that weights of very dense pixels stay normal float32 numbers."""
