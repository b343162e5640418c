"""Twin of `stochastic`, with the same hash: the same fragments cover the same samples."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from renderer.reference.pixels import Floats, Pixel, picture_of
from renderer.techniques.stochastic import SAMPLES
from schemas.fragments import FragmentDump

Words = NDArray[np.uint32]
Mask = NDArray[np.bool_]


def pcg(x: Words) -> Words:
    """PCG-RXS-M-XS-32 (O'Neill 2014) of uint32 words of any shape."""
    state = x * np.uint32(747796405) + np.uint32(2891336453)
    word = ((state >> ((state >> np.uint32(28)) + np.uint32(4))) ^ state) * np.uint32(277803737)
    return np.asarray((word >> np.uint32(22)) ^ word)


def coverage(index: NDArray[np.integer], depth: NDArray[np.float32], packed: Words, samples: int, seed: int) -> Mask:
    """Which samples of its pixel each fragment covers, bool [n, samples].

    Args:
        index: int [n], pixels' indices.
        depth: float32 [n], metres.
        packed: uint32 [n], stored colour, alpha in the top byte.
        samples: S.
        seed: As the technique's.
    """
    random = pcg(np.array([seed], dtype=np.uint32))
    for words in (packed, depth.view(np.uint32), index.astype(np.uint32)):
        random = pcg(words ^ random)
    left = ((packed >> np.uint32(24)) * np.uint32(samples) + random % np.uint32(255)) // np.uint32(255)
    covered = np.zeros((len(packed), samples), dtype=bool)
    for sample in range(samples):
        random = pcg(random)
        covered[:, sample] = random % np.uint32(samples - sample) < left
        left = left - covered[:, sample]
    return covered


def visibility(depth: NDArray[np.float32], covered: Mask) -> Floats:
    """The share of samples in which nothing is nearer than each fragment of a pixel, float64 [n].

    Args:
        depth: float32 [n], metres.
        covered: bool [n, samples].
    """
    nearest = np.where(covered, depth[:, None], np.inf).min(axis=0)
    return np.asarray((depth[:, None] <= nearest).mean(axis=1))


def picture(dump: FragmentDump, samples: int = SAMPLES, seed: int = 0) -> Floats:
    """The picture, float64 [P, 3], linear RGB.

    Args:
        dump: Fragments of a view.
        samples: S.
        seed: As the technique's.
    """
    index = np.repeat(np.arange(dump.pixels), dump.counts)
    covered = coverage(index, dump.depth, dump.rgba.view("<u4")[:, 0], samples, seed)

    def colour(pixel: Pixel) -> Floats:
        run = slice(dump.offsets[pixel.index], dump.offsets[pixel.index + 1])
        seen = visibility(pixel.depth, covered[run])
        return pixel.mean(pixel.alpha * seen, float(np.prod(1.0 - pixel.alpha)))

    return picture_of(dump, colour)
