"""Twin of what `kbuffer-temporal` remembers: `shaders/kbuffer-temporal` in float64, one array for each field."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from renderer.allocation.prices import LEAST_PRICE, PRICE_STEPS, RANKS
from renderer.reference.pixels import Floats
from renderer.techniques.kbuffer_temporal import (
    FRAMES,
    MOST_WRONG,
    MOVING_FRAMES,
    SEEN_LEAST,
    SEEN_STEPS,
)
from schemas.colour import linear_to_srgb

Ints = NDArray[np.int64]

LARGEST = 127
"""Steps of a correction, either way."""
MOST_KNOWN = 63
"""The largest n that is."""


@dataclass(frozen=True, slots=True)
class Remembered:
    """What pixels remember between frames, int64 [P] each; see `shaders/kbuffer-temporal/memory.glsl`.

    Attributes:
        is_open: bool [P], whether the pixel had a choice; all else is 0 where it had not.
        correction: Of the ranks of its bins: what is added to their log gain, in `PRICE_STEPS` a unit.
        seen: Log gain of each fragment of the last core bin, in `SEEN_STEPS` a unit above `SEEN_LEAST`.
        cut: Bins in the core when that was seen; 0: it was not.
        frames: That have corrected it.
        n: Fragments, at most `MOST_KNOWN`.
    """

    is_open: NDArray[np.bool_]
    correction: Ints
    seen: Ints
    cut: Ints
    frames: Ints
    n: Ints


def nothing(pixels: int) -> Remembered:
    """What is remembered before the first frame."""
    return unpacked(np.zeros(pixels, dtype=np.uint32))


def unpacked(words: NDArray[np.uint32]) -> Remembered:
    """The fields of words.

    Args:
        words: uint32 of any shape, what pixels remember; 0: nothing.
    """
    whole = words.astype(np.int64)
    is_open = whole != 0
    return Remembered(
        is_open=is_open,
        correction=np.where(is_open, (whole & 255) - 128, 0),
        seen=whole >> 8 & 255,
        cut=whole >> 16 & 63,
        frames=whole >> 22 & 15,
        n=whole >> 26,
    )


def corrected(
    before: Remembered, ranks: NDArray[np.integer], n: NDArray[np.integer], is_open: NDArray[np.bool_], still: bool
) -> tuple[Ints, Remembered]:
    """Ranks of bins with what was seen of the last frame.

    Args:
        before: What was remembered.
        ranks: int [P, B], as predicted.
        n: int [P], fragments.
        is_open: bool [P], whether the pixel has a choice: `n > 0`, and not all fits.
        still: Whether the camera has not moved.

    Returns:
        int64 [P, B], ranks corrected; what is remembered until something is seen.
    """
    known = np.minimum(n, MOST_KNOWN).astype(np.int64)
    alike = 8 * np.abs(known - before.n) <= np.maximum(known, before.n)
    goes_on = is_open & before.is_open & alike
    correction, frames = (np.where(goes_on, field, 0) for field in (before.correction, before.frames))

    given = correction / PRICE_STEPS
    last = np.take_along_axis(ranks.astype(np.int64), np.clip(before.cut, 1, ranks.shape[1])[:, None] - 1, axis=1)[:, 0]
    price = last / PRICE_STEPS + LEAST_PRICE
    wrong = np.clip(before.seen / SEEN_STEPS + SEEN_LEAST + price - given, -MOST_WRONG, MOST_WRONG)
    moved = np.floor((given + wrong / (frames + 2)) * PRICE_STEPS + 0.5)
    learns = goes_on & (before.cut > 0) & (frames < FRAMES)
    correction = np.where(learns, np.clip(moved, -LARGEST, LARGEST), correction).astype(np.int64)
    frames = frames + learns
    if not still:
        frames = np.minimum(frames, MOVING_FRAMES)

    unseen = np.zeros_like(known)
    kept = Remembered(is_open, correction, unseen, unseen, frames, np.where(is_open, known, 0))
    return np.clip(ranks.astype(np.int64) - correction[:, None], 0, RANKS - 1), kept


def observed(
    before: Remembered, cut: NDArray[np.integer], last: NDArray[np.integer], seen: Floats, without_last: Floats
) -> Remembered:
    """What is remembered when a frame is resolved.

    Args:
        before: From `corrected`.
        cut: int [P], bins in the core.
        last: int [P], fragments of the last of them.
        seen: float64 [P, 3], linear RGB, the picture.
        without_last: float64 [P, 3], the same with that bin in the tail; not read where there is none.
    """
    gain = np.square(linear_to_srgb(seen) - linear_to_srgb(without_last)).sum(axis=1) / np.maximum(last, 1)
    # NaN is no gain that anybody has seen, and counts as the least.
    log_gain = np.log(np.where(gain > np.exp(SEEN_LEAST), gain, np.exp(SEEN_LEAST)))
    code = np.clip(np.floor((log_gain - SEEN_LEAST) * SEEN_STEPS + 0.5), 0, 255)
    notes = before.is_open & (cut > 0)
    seen_code, seen_cut = np.where(notes, code, 0), np.where(notes, cut, 0)
    return replace(before, seen=seen_code.astype(np.int64), cut=seen_cut.astype(np.int64))
