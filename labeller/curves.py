"""Error curves of all pixels, and pictures of an allocation, in O(N) for a view (METHOD sections 2 and 3).

The compiled part is `labeller.curve_kernels`; all arithmetic is float64, and memory is the curves themselves.
`labeller.reference` is the plain twin that the tests compare with.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from labeller.curve_kernels import Lists, Look, colours_of, errors_of, leave_cuts
from renderer.depth_bins import OPTICAL, bin_form
from renderer.tile_range import pixel_ranges
from schemas.colour import decode_gamma2
from schemas.fragments import FragmentDump
from schemas.problem import ExitCode, Problem
from schemas.tail import DEFAULT_TAIL, DENSITY_G, METRICS, TAILS, MetricName, TailName

_CHUNKS: Final = 256  # more than threads, of equal numbers of fragments: crowded regions are shared out
_LEVELS: Final = np.arange(256, dtype=np.float64) / 255.0
_NOTHING: Final = np.empty(0, dtype=np.float64)


UNREACHABLE: Final = 1e30
"""Error of a k that no cut gives: above any other, and no hull reaches up to it."""


@dataclass(frozen=True, slots=True)
class Curves:
    """Error curves of a view: `e_p(k)` for k = 0..n(p) is `error[offsets[p] + k]`.

    Attributes:
        offsets: int64 [P+1].
        error: float32 [N+P], squared difference from the exact colour, summed over RGB; `e_p(n) = 0`.
        tail: Tail that stands for the fragments beyond k.
        g: Steepness of the density tail.
        metric: Space in which the difference is measured.
    """

    offsets: NDArray[np.int64]
    error: NDArray[np.float32]
    tail: TailName
    g: float
    metric: MetricName

    @property
    def counts(self) -> NDArray[np.int64]:
        """int64 [P], n(p)."""
        return np.diff(self.offsets) - 1

    def at(self, k: NDArray[np.integer]) -> NDArray[np.float32]:
        """float32 [P], `e_p(k_p)` for k int [P] with 0 <= k <= n.

        Args:
            k: Integers [P], core fragments of each pixel, 0 <= k <= n.
        """
        return self.error[self.offsets[:-1] + k]

    def total(self, k: NDArray[np.integer]) -> float:
        """Sum of `e_p(k_p)` over the view, in float64.

        Args:
            k: Integers [P], core fragments of each pixel, 0 <= k <= n.
        """
        return float(self.at(k).sum(dtype=np.float64))


def error_curves(
    dump: FragmentDump,
    tail: TailName = DEFAULT_TAIL,
    g: float = DENSITY_G,
    metric: MetricName = "display",
    weights: NDArray[np.floating] | None = None,
) -> Curves:
    """Errors of all pixels for all numbers of core fragments.

    Args:
        dump: Fragments of a view.
        tail: One of `schemas.tail.TAILS`.
        g: Steepness of the density tail, >= 0.
        metric: `display`: sRGB, clamped; `linear`: linear RGB; `paper`: stored values composited as they are.
        weights: [P] >= 0, what a pixel's errors count (saliency, the slope of FLIP); None: every pixel counts 1.

    Raises:
        Problem: If the dump is malformed or has a depth that is not finite, or if weights are not such numbers.
    """
    (steepness,) = _checked_g((g,))
    return _error_curves(dump, tail, (steepness if tail == "density" else 0.0,), steepness, metric, weights)[0]


def error_curves_by_g(
    dump: FragmentDump,
    gs: Sequence[float],
    metric: MetricName = "display",
    weights: NDArray[np.floating] | None = None,
) -> list[Curves]:
    """Errors with the density tail for several steepnesses at once: lists are read, composited and encoded once.

    Args:
        dump: Fragments of a view.
        gs: Steepnesses, >= 0.
        metric: As of `error_curves`.
        weights: As of `error_curves`.

    Returns:
        For each g what `error_curves` gives for it, bit for bit.

    Raises:
        Problem: As of `error_curves`.
    """
    return _error_curves(dump, "density", tuple(gs), 0.0, metric, weights)


def _error_curves(
    dump: FragmentDump,
    tail: TailName,
    gs: Sequence[float],
    g: float,
    metric: MetricName,
    weights: NDArray[np.floating] | None,
) -> list[Curves]:
    check_dump(dump)
    steep = _checked_g(gs)
    offsets = dump.offsets + np.arange(dump.pixels + 1)
    error = np.empty((len(steep), dump.total + dump.pixels), dtype=np.float32)
    errors_of(_lists(dump, tail), _look(tail, metric), steep, _checked_weights(weights, dump.pixels), error)
    return [
        Curves(offsets, e, tail, float(s) if tail == "density" else float(g), metric)
        for e, s in zip(error, steep, strict=True)
    ]


def _checked_g(gs: Sequence[float]) -> NDArray[np.float64]:
    try:
        steep = np.array(gs, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        steep = np.full(1, np.nan)
    if not (steep.ndim == 1 and np.isfinite(steep).all() and (steep >= 0.0).all()):
        raise Problem(f"The density tail's g is {gs}.", "Give finite numbers that are not negative.", ExitCode.USAGE)
    return steep


def _checked_weights(weights: NDArray[np.floating] | None, pixels: int) -> NDArray[np.float64]:
    """Weights in float64, or none.

    Raises:
        Problem: They are not one number >= 0 a pixel, or so large or small that errors leave the range of float32.
    """
    if weights is None:
        return _NOTHING
    w = np.asarray(weights, dtype=np.float64).reshape(-1)
    if len(w) != pixels:
        raise Problem(f"There are {len(w)} weights for {pixels} pixels.", "Give one weight a pixel.", ExitCode.USAGE)
    positive = w[w > 0.0]
    if not (
        np.isfinite(w).all()
        and (w >= 0.0).all()
        and positive.max(initial=1.0) <= 1e9
        and positive.min(initial=1.0) >= 1e-9
    ):
        raise Problem(
            "The weights of the pixels are not numbers that can be used.",
            "Give 0 for pixels that do not count, and numbers from 1e-9 to 1e9 for the others.",
            ExitCode.USAGE,
        )
    return w


def whole_bins(dump: FragmentDump, curves: Curves) -> Curves:
    """The same curves where a core is all fragments of a pixel's first depth bins: other k have the error UNREACHABLE.

    Args:
        dump: Fragments of the view.
        curves: Of a tail with bins.
    """
    error = curves.error.copy()
    leave_cuts(_lists(dump, curves.tail), TAILS[curves.tail].bins, np.float32(UNREACHABLE), error)
    return replace(curves, error=error)


def composite(
    dump: FragmentDump, k: NDArray[np.integer], tail: TailName = DEFAULT_TAIL, g: float = DENSITY_G
) -> NDArray[np.float32]:
    """The picture that an allocation gives.

    Args:
        dump: Fragments of a view.
        k: int [P], core fragments of each pixel, >= 0; clipped to n(p), where the result is exact.
        tail: One of `schemas.tail.TAILS`.
        g: Steepness of the density tail.

    Returns:
        float32 [P, 3], linear RGB.

    Raises:
        Problem: If the dump is malformed or has a depth that is not finite, or if g is not a number >= 0.
    """
    check_dump(dump)
    (g,) = _checked_g((g,))
    out = np.empty((dump.pixels, 3), dtype=np.float32)
    kept = np.clip(np.asarray(k), 0, dump.counts).astype(np.int32)
    colours_of(_lists(dump, tail), _look(tail, "linear"), float(g), kept, out)
    return out


def check_dump(dump: FragmentDump) -> None:
    """Refuse a dump whose parts do not fit together, or with a depth that is not a positive number.

    What is compiled goes by shapes and types without a look: those of any other would be read beyond their ends.

    Raises:
        Problem: What is wrong.
    """
    fits = (
        dump.offsets.shape == (dump.pixels + 1,)
        and dump.offsets[0] == 0
        and dump.offsets[-1] == dump.total
        and bool((dump.counts >= 0).all())
        and (dump.depth.shape, dump.rgba.shape) == ((dump.total,), (dump.total, 4))
        and (dump.background.shape, dump.facing.shape) == ((dump.pixels, 3), (dump.pixels,))
        and dump.offsets.dtype == np.int64
        and dump.depth.dtype == np.float32
        and all(array.dtype == np.uint8 for array in (dump.rgba, dump.background, dump.facing))
    )
    if not fits:
        raise Problem("The fragment dump is malformed: lists, size and types do not fit.", "Render the view again.")
    if not (np.isfinite(dump.depth).all() and dump.depth.min(initial=1.0) > 0.0):
        raise Problem(
            "The fragment dump has depths that are not positive numbers.",
            "Look for NaN or infinite points in the scene, and render the view again.",
        )


def _lists(dump: FragmentDump, tail: TailName) -> Lists:
    work = dump.offsets + np.arange(dump.pixels + 1)
    chunks = np.searchsorted(work, np.linspace(0, work[-1], _CHUNKS + 1)).astype(np.int64)
    nearest = extent = np.empty(0, dtype=np.float32)
    if TAILS[tail].bins:
        ranges = pixel_ranges(dump)
        nearest, extent = ranges.nearest, ranges.extent
    return Lists(dump.offsets, dump.rgba, dump.depth, dump.background, nearest, extent, chunks)


def _look(tail: TailName, metric: MetricName) -> Look:
    decode = _LEVELS if metric == "paper" else decode_gamma2(np.arange(256, dtype=np.uint8))
    row = TAILS[tail]
    return Look(int(row.kind), *bin_form(row), METRICS.index(metric), decode, _LEVELS, OPTICAL)
