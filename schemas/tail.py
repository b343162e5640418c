"""Names and constants of the tails (METHOD.md section 2) and of the error metrics (section 1)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal, get_args

TailName = Literal["density", "exact-coverage", "weighted-average", "paper", "density-8", "density-16"]
MetricName = Literal["display", "linear", "paper"]

TAILS: tuple[TailName, ...] = get_args(TailName)
TAIL_HELP = f"One of {', '.join(TAILS)}."
"""For the help of a command's option."""
METRICS: tuple[MetricName, ...] = get_args(MetricName)

DEFAULT_TAIL: TailName = "density-16"

DENSITY_G = 0.75
"""Default g of the density tail, `w_i = a_i exp(-g D x_i)`."""

DENSITY_BINS: Mapping[TailName, int] = {"density-8": 8, "density-16": 16}
"""Tails that know in which of so many depth bins a pixel's optical depth lies; the others assume it spread evenly."""

OPTICAL_UNIT = 951
"""Depth bins count optical depth in so many units of 1, up to BIN_LIMIT: integers, so that a sum does not depend on the
order. No stored alpha's number of units is within .01 of a half, so that every logarithm rounds alike."""

BIN_LIMIT = 65_535
"""Where a depth bin is full: 16 bits, an optical depth of 69, behind which nothing is visible."""

SHARE_LEVELS = 15
"""Steps in which the share of the optical depth in front of a bin is kept: 4 bits."""

ROOT_SHARE = 0.6
PLAIN_SHARE = 0.4
"""Depth bins are equal in `y = PLAIN_SHARE x + ROOT_SHARE sqrt(x)`: finer in front, where more is visible.

Two numbers, each the float32 nearest to it: languages differ in what `1 - ROOT_SHARE` is."""

MAX_EXPONENT = 60.0
"""The exponent `g D x` is clamped here, so that weights of very dense pixels stay normal float32 numbers."""
