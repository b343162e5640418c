"""Twin of what `kbuffer-temporal` remembers: `shaders/kbuffer-temporal` in float64, one array for each field."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from renderer.reference.pixels import Floats
from renderer.techniques.kbuffer_temporal import (
    CORRECTION_STEPS,
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
MOST_SEEN = 63
"""The largest k that is noted; of pixels with more nothing is."""
MOST_KNOWN = 63
"""The largest n that is."""


@dataclass(frozen=True, slots=True)
class Remembered:
    """What pixels remember between frames, int64 [P] each; see `shaders/kbuffer-temporal/memory.glsl`.

    Attributes:
        is_open: bool [P], whether the pixel had a choice; all else is 0 where it had not.
        correction: Of the log gain, in `CORRECTION_STEPS` a unit.
        seen: Log gain of the last core fragment, in `SEEN_STEPS` a unit above `SEEN_LEAST`.
        k: Core fragments when that was seen; 0: it was not.
        frames: That have corrected it.
        n: Fragments, at most `MOST_KNOWN`.
    """

    is_open: NDArray[np.bool_]
    correction: Ints
    seen: Ints
    k: Ints
    frames: Ints
    n: Ints


def nothing(pixels: int) -> Remembered:
    """What is remembered before the first frame."""
    return unpacked(np.zeros(pixels, dtype=np.uint32))


def unpacked(words: NDArray[np.uint32]) -> Remembered:
    """The fields of words."""
    whole = words.astype(np.int64)
    is_open = whole != 0
    return Remembered(
        is_open=is_open,
        correction=np.where(is_open, (whole & 255) - 128, 0),
        seen=whole >> 8 & 255,
        k=whole >> 16 & 63,
        frames=whole >> 22 & 15,
        n=whole >> 26,
    )


def corrected(
    before: Remembered, a: Floats, b: Floats, n: NDArray[np.integer], is_open: NDArray[np.bool_], still: bool
) -> tuple[Floats, Remembered]:
    """Gain curves with what was seen of the last frame.

    Args:
        before: What was remembered.
        a: float64 [P], log gain of the first fragment as predicted; finite.
        b: float64 [P], decay per fragment; finite, > 0.
        n: int [P], fragments.
        is_open: bool [P], whether the pixel has a choice: `n > 0`, and not all fits.
        still: Whether the camera has not moved.

    Returns:
        float64 [P], a corrected; what is remembered until something is seen.
    """
    known = np.minimum(n, MOST_KNOWN).astype(np.int64)
    alike = 8 * np.abs(known - before.n) <= np.maximum(known, before.n)
    goes_on = is_open & before.is_open & alike
    correction, frames = (np.where(goes_on, field, 0) for field in (before.correction, before.frames))

    given = correction / CORRECTION_STEPS
    expected = a + given - b * (before.k - 1)
    wrong = np.clip(before.seen / SEEN_STEPS + SEEN_LEAST - expected, -MOST_WRONG, MOST_WRONG)
    moved = np.floor((given + wrong / (frames + 2)) * CORRECTION_STEPS + 0.5)
    learns = goes_on & (before.k > 0) & (frames < FRAMES)
    correction = np.where(learns, np.clip(moved, -LARGEST, LARGEST), correction).astype(np.int64)
    frames = frames + learns
    if not still:
        frames = np.minimum(frames, MOVING_FRAMES)

    unseen = np.zeros_like(known)
    kept = Remembered(is_open, correction, unseen, unseen, frames, np.where(is_open, known, 0))
    return np.asarray(a + correction / CORRECTION_STEPS, dtype=np.float64), kept


def observed(before: Remembered, k: NDArray[np.integer], seen: Floats, without_last: Floats) -> Remembered:
    """What is remembered when a frame is resolved.

    Args:
        before: From `corrected`.
        k: int [P], core fragments.
        seen: float64 [P, 3], linear RGB, the picture.
        without_last: float64 [P, 3], the same with one core fragment less; not read where k is 0.
    """
    gain = np.square(linear_to_srgb(seen) - linear_to_srgb(without_last)).sum(axis=1)
    # NaN is no gain that anybody has seen, and counts as the least.
    log_gain = np.log(np.where(gain > np.exp(SEEN_LEAST), gain, np.exp(SEEN_LEAST)))
    code = np.clip(np.floor((log_gain - SEEN_LEAST) * SEEN_STEPS + 0.5), 0, 255)
    notes = before.is_open & (k > 0) & (k <= MOST_SEEN)
    return replace(before, seen=np.where(notes, code, 0).astype(np.int64), k=np.where(notes, k, 0).astype(np.int64))
