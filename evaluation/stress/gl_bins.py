"""Depth bins in GLSL: the ranges of tiles, what is kept of the bins, fragments by bin, sums of luma beside them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evaluation.stress.findings import Finding, compared
from evaluation.stress.gl_bounds import bound_of
from evaluation.stress.gl_capture import Geometry
from evaluation.stress.gl_cases import Case, thinned
from evaluation.stress.twins import sums64
from labeller import reference
from renderer.features import LUMA_SUMS, SUMS
from renderer.tile_range import STEPS, tile_grid
from schemas.tail import (
    BINNED_TAILS,
    LUMA_SHIFT,
    LUMA_SQUARE_SHIFT,
    OPTICAL_UNIT,
    RANGE_TILE,
    TAILS,
    TailName,
)

Floats = NDArray[np.float64]

_SPACING = RANGE_TILE // STEPS
"""Pixels between the rays that a tile's range is estimated from."""
_REACH = 0.0501
"""How much farther than those rays see a range may reach, relative (`range/range.frag`)."""
_ROUNDING = 1e-5
"""Relative: what rounding, and polygons that amplify it, may move a depth by."""
_LUMA = [SUMS.index(name) for name in LUMA_SUMS]
_LUMA_UNITS = np.array([2**LUMA_SHIFT / 255.0, 2**LUMA_SQUARE_SHIFT / 255.0**2]) / OPTICAL_UNIT


@dataclass(frozen=True, slots=True)
class Judge:
    """Rows of the pixels that a case compares and that have fragments.

    Attributes:
        case: The case.
        pixels: int64 [M].
        driver: For the paths.
    """

    case: Case
    pixels: NDArray[np.int64]
    driver: str

    @classmethod
    def of(cls, case: Case, driver: str) -> Judge:
        """Of a case."""
        return cls(case, case.pixels[case.dump.counts[case.pixels] > 0], driver)

    def row(
        self,
        key: str,
        found: NDArray[np.generic],
        truth: NDArray[np.generic],
        names: Sequence[str],
        path: str = "",
        amplified: NDArray[np.floating] | float = 1.0,
    ) -> Finding:
        """One row for [pixels, names]; errors are divided by what a pixel amplifies them by.

        Args:
            key: Of the bound.
            found: [M, len(names)].
            truth: The same shape.
            names: Of the columns.
            path: Of the row; else the key.
            amplified: [M, 1], or one number.
        """
        bound = bound_of(key, self.case.scenery.deep)

        def where(index: tuple[int, ...]) -> str:
            return f"{names[index[1]]}, {self.case.place(int(self.pixels[index[0]]))}"

        expected = np.asarray(truth, np.float64)
        made = expected + (np.asarray(found, np.float64) - expected) / amplified
        name = f"{path or key} · {self.driver}"
        return compared(name, self.case.name, made, expected, bound.value, bound.measure, bound.floor, where)


def rows(case: Case, driver: str) -> Iterator[Finding]:
    """Ranges of all tiles, and the bins of the pixels that a case compares and that have fragments."""
    yield _ranges(case, driver)
    judge = Judge.of(case, driver)
    for tail in BINNED_TAILS:
        yield from _bins(judge, tail)


def _ranges(case: Case, driver: str) -> Finding:
    """Tiles whose range leaves out what a ray sees, or reaches much farther; found in float64."""
    ranges = np.frombuffer(case.frame.tile_range().read(), np.float32).reshape(-1, 2).astype(np.float64)
    columns, tiles = tile_grid(case.frame.width, case.frame.height)[0], len(ranges)
    geometry = Geometry(case.scenery, _SPACING)
    hits = geometry.hits()
    ray, polygon = np.divmod(hits.key, len(geometry.corners))
    across = columns * STEPS
    tile = ray // across // STEPS * columns + ray % across // STEPS
    clear = ~np.isin(geometry.rgba[polygon, 3], (0, 255)) if geometry.mixed else np.ones(len(polygon), bool)
    met, sure = tile[clear], tile[clear & hits.sure]
    nearest, farthest = np.full((2, tiles), np.inf), np.full((2, tiles), -np.inf)
    for level, (places, some) in enumerate(((met, clear), (sure, clear & hits.sure))):
        np.minimum.at(nearest[level], places, hits.depth[some])
        np.maximum.at(farthest[level], places, hits.depth[some])
    near, far = ranges.T
    wrong = ~np.isfinite(ranges).all(axis=1) | (near > far) | (near < 0.0)
    wrong |= (near > nearest[1] * (1.0 + _ROUNDING)) | (far < farthest[1] * (1.0 - _ROUNDING))
    seen = np.isfinite(nearest[1])  # others have the range of those around them
    wrong |= seen & ((near < nearest[0] * (1.0 - _REACH)) | (far > farthest[0] * (1.0 + _REACH)))
    bound, count = bound_of("range", deep=False), float(wrong.sum())
    where = f"{case.scenery.name}, tile {np.argmax(wrong)} of {tiles}" if count else "nowhere"
    return Finding(f"range · {driver}", case.name, count, count / tiles, where, bound.value, bound.measure)


def counted_bins(case: Case, pixels: NDArray[np.integer], tail: TailName) -> NDArray[np.int64]:
    """int64 [M, B], fragments of each depth bin of some pixels, in plain Python; 255 for that many or more.

    Args:
        case: Input.
        pixels: Integers [M], indices of pixels.
        tail: A tail with depth bins.
    """
    found = np.zeros((len(pixels), TAILS[tail].bins), np.int64)
    for row, p in zip(found, pixels.tolist(), strict=True):
        np.add.at(row, _depth_bins(case, p, tail).bin, 1)
    return np.minimum(found, 255)


def _depth_bins(case: Case, p: int, tail: TailName) -> reference.DepthBins:
    pixel = reference.pixel_of(case.dump, p)
    return reference.depth_bins(pixel, -np.log(np.maximum(1.0 - pixel.alpha, 1e-3)), TAILS[tail])


def _bins(judge: Judge, tail: TailName) -> Iterator[Finding]:
    frame, row = judge.case.frame, TAILS[tail]
    binned = frame.gather_bins(tail, luma=True)
    words = binned.kept()[judge.pixels]
    expected = np.zeros_like(words, dtype=np.int64)
    for out, p in zip(expected, judge.pixels.tolist(), strict=True):
        kept = _depth_bins(judge.case, p, tail)
        shares, means = np.rint(kept.front[1:] * row.share_levels), np.rint(kept.mean * row.mean_levels)
        out[:] = 256 * shares + (means if row.mean_levels else 0)
        out[-1] = kept.units
    names = [f"{tail}, bin {b}" for b in range(row.bins)]
    yield judge.row("bins.kept", words, expected, names)
    counts = binned.counts()[judge.pixels]
    yield judge.row("bins.counts", counts, counted_bins(judge.case, judge.pixels, tail), names)
    truth = sums64(thinned(judge.case.dump, judge.pixels), tail)[judge.pixels]
    luma = binned.read()[judge.pixels, row.bins]
    found = np.stack([luma >> 16, luma & 0xFFFF], axis=1)
    yield judge.row("bins.luma", found, np.rint(truth[:, _LUMA] / _LUMA_UNITS), LUMA_SUMS)
