"""How far each fast path of the CPU may be off, and why. docs/STRESS.md prints this table."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from numpy.typing import ArrayLike

from evaluation.stress.findings import INFORMATION, Bound, Finding, compared

PIXEL_FLOOR: Final = 1e-9
"""Squared errors below this are no error that a pixel can show: a 120th of a step of an 8-bit channel."""
CURVE_FLOOR: Final = 1e-12
"""Of single squared errors: below, they are differences of display values of a millionth."""

BOUNDS: Final[dict[str, Bound]] = {
    "reference": Bound(
        1e-12,
        "absolute",
        1.0,
        "The float64 reference itself, against extended precision where the platform has it: what the other rows "
        "are compared with is right to this. 4096 products and sums of numbers up to 1 lose 4096 x 2^-52 = 9e-13.",
    ),
    "transmittance": Bound(
        1e-7,
        "relative",
        1e-37,
        "`T` as pictures have it: a white background behind black fragments. The running product is float64, the "
        "picture float32: 2^-24 = 6e-8. The floor is near the least normal float32.",
    ),
    "transmittance.float32": Bound(
        INFORMATION,
        "relative",
        1e-37,
        "`T` as the running product in float32, as shaders have it; the rows of GL paths judge it. Two roundings a "
        "factor: 4096 x (2^-24 + 2^-25) = 4e-4 at most.",
    ),
    "transmittance.rejected": Bound(
        INFORMATION,
        "relative",
        1e-37,
        "`T` as `1 - sum v`, which is not used: it cancels. What is left of a small `T` is the rounding of the sum, of "
        "either sign, so that nothing of the order of the background is right behind dense pixels.",
    ),
    "curves": Bound(
        1e-7,
        "relative",
        CURVE_FLOOR,
        "Arithmetic is float64, storage float32: half a unit in the last place is 2^-24 = 6e-8; the rest is for the "
        "polynomial that stands for the sRGB curve. The floor is a difference of 1e-6 in display values.",
    ),
    "curves.search": Bound(1e-7, "relative", CURVE_FLOOR, "The same for the worst list that a search finds."),
    "curves.weights": Bound(
        1.2e-7, "relative", CURVE_FLOOR, "Errors times weights of 1e-9 to 1e9: the same, divided by the weight again."
    ),
    "curves.by_g": Bound(0.0, "absolute", 1.0, "Errors that differ from those of one g alone."),
    "composite": Bound(
        1e-7, "absolute", 1e-6, "Linear colours in [0, 1], and up to 2 for the tail `paper`, rounded to float32 once."
    ),
    "exponents": Bound(
        1e-11,
        "relative",
        1.0,
        "Optical depths in front of fragments, as the depth bins of the binned tails tell them, up to the 60 where "
        "weights end. The operations are the same, in float64; should a compiler fuse some, each is a "
        "rounding of `D`, at most 22,700 x 2^-53 = 2.5e-12 for 4096 fragments of 254/255.",
    ),
    "csr": Bound(0.0, "absolute", 1.0, "Sorting moves bits: fragments in another place than a stable sort puts them."),
    "hull": Bound(
        1e-12,
        "relative",
        PIXEL_FLOOR,
        "Against hulls in exact rational arithmetic. Whether a vertex is on the hull is decided by products in "
        "float64; where they are within rounding of each other, either hull is as low.",
    ),
    "hull.slopes": Bound(0.0, "absolute", 1.0, "Slopes that rise along a hull: the selection relies on none."),
    "selection": Bound(0.0, "absolute", 1.0, "Thresholds that differ from those of a sorted list."),
    "greedy": Bound(0.0, "absolute", 1.0, "Pixels whose k differs from the literal heap's, ties included."),
    "increment": Bound(0.0, "absolute", 1.0, "Pixels whose k differs from the literal heap's, ties included."),
    "limits": Bound(
        0.0, "absolute", 1.0, "Pixels outside of `0 <= K <= n`, fragments above F, errors that are not finite."
    ),
    "bands": Bound(0.0, "absolute", 1.0, "Pixels whose k differs where the view comes in row bands."),
    "optimal.greedy": Bound(
        1e-9, "relative", PIXEL_FLOOR, "By how much `optimal` is above `greedy` or `increment` at the same budget."
    ),
    "optimal.bound": Bound(
        1e-9,
        "relative",
        PIXEL_FLOOR,
        "By how much the lower bound is above the true optimum, by exhaustive dynamic programming. Curves are "
        "float32, their sums float64 in another order.",
    ),
    "optimal.rising": Bound(
        1e-4,
        "relative",
        PIXEL_FLOOR,
        "By how much the error of `optimal` rises with F. It is optimal up to its certificate only, so it may by "
        "the gap, and no more than the gap's own limit. The floor is per pixel.",
    ),
    "fill.limits": Bound(
        0.0,
        "absolute",
        1.0,
        "Fragments that a fill misses F by, pixels outside of `[0, n]`. Of cuts: fragments above F, cores that are not "
        "whole bins, bins of a pixel that come next and would fit.",
    ),
    "fill.budget": Bound(
        1e-12,
        "relative",
        1.0,
        "How much later, on the scale of `t`, a fragment that was given comes than one that was not, against sorted "
        "float64 thresholds. Fills bracket `t` down to neighbouring float64 numbers.",
    ),
    "fill.cuts": Bound(
        1.01,
        "absolute",
        1.0,
        "The same for whole bins, in ranks of prices, as compute passes have them: what comes at one rank is handed "
        "out by pixel index. The hundredth is for prices in float32.",
    ),
    "fill.order": Bound(
        0.0,
        "absolute",
        1.0,
        "Pixels whose count changes with the order of 1e7 importances, or with the number of threads: the fill sums "
        "integers only.",
    ),
    "sum": Bound(
        1e-12,
        "relative",
        1.0,
        "Sums that do matter, as in DHOIT's Eq. 3 and in a view's total error, in float64: 1e7 x 2^-53 = 1e-9 at the "
        "very worst, 1e-12 in practice, since the sums are pairwise.",
    ),
    "sum.rejected": Bound(
        INFORMATION,
        "relative",
        1.0,
        "The same numbers in one float32 accumulator, which is not used: small terms vanish beside a large sum.",
    ),
    "features.gather": Bound(
        1e-7, "relative", 1e-30, "Sums in float64, rounded to float32 once: 2^-24 = 6e-8. The floor only excludes 0."
    ),
    "features.derive": Bound(
        3e-6,
        "relative",
        1.0,
        "All features but the spread, in float32 as in a shader, against float64 from the fragments on.",
    ),
    "features.spread": Bound(
        1e-5,
        "absolute",
        1.0,
        "Standard deviations, `sqrt(max(1e-3, E[x^2] - E[x]^2))`: the difference is right to 2e-7, and the root makes "
        "16 times that of it at the least. The weakest bound here.",
    ),
    "features.kept": Bound(
        0.0,
        "absolute",
        1.0,
        "`front_b` and `mean_b` of every binned tail that are another step than in integer arithmetic. Bins are found "
        "by float32 operations that are the same everywhere, and count integers.",
    ),
    "features.float16": Bound(
        INFORMATION,
        "relative",
        1.0,
        "What a network would predict of features stored as float16. Nothing stores them so: features are float32 in "
        "shards and shaders.",
    ),
    "predict.numpy": Bound(1e-5, "relative", 1.0, "float32 dot products of a few dozen terms. The bundle's own limit."),
    "predict.torch": Bound(1e-5, "relative", 1.0, "The same in torch."),
    "predict.onnx": Bound(1e-5, "relative", 1.0, "The same in onnxruntime, as the renderer runs it."),
    "predict.search": Bound(1e-5, "relative", 1.0, "The same for the worst features that a search finds."),
    "predict.ranks": Bound(
        1.0,
        "absolute",
        1.0,
        "By how much the rank of a bin differs between float64 and a float32 form: where `floor` is at a step, it may "
        "be one.",
    ),
    "refused.arrays": Bound(
        0.0, "absolute", 1.0, "Arrays with NaN or infinity that are not refused with a clear error."
    ),
}
"""Fast path -> bound."""


def within(path: str, case: str, found: ArrayLike, reference: ArrayLike, places: Sequence[str]) -> Finding:
    """The worst row of some numbers, judged by the path's bound.

    Args:
        path: Fast path, a key of `BOUNDS`.
        case: The input.
        found: What the fast path made, [rows, ...].
        reference: float64 of the same shape.
        places: Name of each row.
    """
    bound = BOUNDS[path]
    return compared(
        path, case, found, reference, bound.value, bound.measure, bound.floor, lambda index: places[index[0]]
    )


def counted(path: str, case: str, violations: float, where: str = "") -> Finding:
    """A row that counts what must not be; any is a violation where the path's bound is 0."""
    bound = BOUNDS[path]
    value = float(violations)
    return Finding(path, case, value, value, where or "nowhere", bound.value, bound.measure)
