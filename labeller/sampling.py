"""Which pixels of a view become rows of a data set."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

SamplingKind = Literal["stratified", "uniform"]


class Sampling(BaseModel):
    """How rows are drawn.

    Attributes:
        kind: `stratified`: the same share of every n; `uniform`: every pixel with the same probability (DHOIT).
        fraction: Share of the pixels with fragments.
        seed: Equal seeds give equal samples.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    kind: SamplingKind = "stratified"
    fraction: float = Field(default=0.2, gt=0.0, le=1.0)
    seed: int = Field(default=0, ge=0)


def sample_pixels(pixels: NDArray[np.integer], n: NDArray[np.integer], sampling: Sampling) -> NDArray[np.int64]:
    """A share of the pixels.

    Args:
        pixels: [E], pixel indices.
        n: [E], fragments of each.
        sampling: How.

    Returns:
        int64, ascending.
    """
    if sampling.kind == "uniform":
        return uniform_sample(pixels, sampling.fraction, sampling.seed)
    return stratified_sample(pixels, n, sampling.fraction, sampling.seed)


def stratified_sample(
    pixels: NDArray[np.integer], n: NDArray[np.integer], fraction: float, seed: int
) -> NDArray[np.int64]:
    """A share of the pixels, spread evenly over n: every (1/fraction)-th in random order within equal n.

    Args:
        pixels: [E], pixel indices.
        n: [E], fragments of each.
        fraction: Share to take, in (0, 1].
        seed: Equal seeds give equal samples.

    Returns:
        int64, ascending.
    """
    rng = np.random.default_rng(seed)
    shuffled = rng.permutation(len(pixels))
    ordered = shuffled[np.argsort(n[shuffled], kind="stable")]
    chosen = np.floor((np.arange(math.ceil(len(pixels) * fraction)) + rng.random()) / fraction).astype(np.int64)
    return np.sort(pixels[ordered[chosen[chosen < len(pixels)]]]).astype(np.int64)


def uniform_sample(pixels: NDArray[np.integer], fraction: float, seed: int) -> NDArray[np.int64]:
    """A share of the pixels, all with the same probability, as DHOIT draws them.

    Args:
        pixels: [E], pixel indices.
        fraction: Share to take, in (0, 1].
        seed: Equal seeds give equal samples.

    Returns:
        int64, ascending.
    """
    count = round(len(pixels) * fraction)
    return np.sort(np.random.default_rng(seed).choice(pixels, size=count, replace=False)).astype(np.int64)
