"""Names and constants of the tails (METHOD.md section 2) and of the error metrics (section 1)."""

from __future__ import annotations

from typing import Literal, get_args

TailName = Literal["density", "exact-coverage", "weighted-average", "paper"]
MetricName = Literal["display", "linear", "paper"]

TAILS: tuple[TailName, ...] = get_args(TailName)
METRICS: tuple[MetricName, ...] = get_args(MetricName)

DENSITY_G = 0.75
"""Default g of the density tail, `w_i = a_i exp(-g D x_i)`."""

MAX_EXPONENT = 60.0
"""The exponent `g D x` is clamped here, so that weights of very dense pixels stay normal float32 numbers."""
