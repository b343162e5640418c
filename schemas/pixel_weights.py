"""Names of what a pixel's errors count in the labels that a network learns from (`labeller.flip_weights`)."""

from __future__ import annotations

from typing import Any, Literal

PixelWeights = Literal["none", "flip"]
"""`none`: every pixel's squared error in display space counts alike; `flip`: as FLIP sees it."""

DEFAULT_WEIGHTS: PixelWeights = "none"


def without_default(described: dict[str, Any]) -> dict[str, Any]:
    """What is written of something with `weights`: they are named only where there are any."""
    if described["weights"] == DEFAULT_WEIGHTS:
        del described["weights"]
    return described
