"""How far each GLSL pass may be off, and why. docs/STRESS.md prints these tables."""

from __future__ import annotations

from typing import Final

from evaluation.stress.findings import INFORMATION, Bound

PICTURE_FLOOR: Final = 1e-3
"""Linear light: relative errors of darker values are relative to this."""


def _picture(value: float, why: str) -> Bound:
    return Bound(value, "absolute", PICTURE_FLOOR, why)


_ORDERED = _picture(
    1e-6,
    "Up to 100 fragments: products of `1 - a` and sums below 1, a rounding of 2^-24 each, most of which cancel.",
)
_ORDERED_DEEP = _picture(
    6e-6,
    "`1 - a` is rounded once, and the same error is in every factor of `T`: `n T 2^-24 <= 255 / e 2^-24 = 5.6e-6` with "
    "alpha 1/255, the worst of all alphas; beyond n = 255 there is less and less to see.",
)
BOUNDS: Final[dict[str, Bound]] = {
    "capture.fragments": Bound(0.0, "absolute", 1.0, "Fragments missing, twice, or too many; edges left out."),
    "capture.depth": Bound(
        1.2e-6,
        "relative",
        1.0,
        "View depth, relative, over what the geometry amplifies: a polygon at a grazing angle, or much larger than its "
        "distance, cancels digits of its plane. For polygons that face the eye it is 1.2e-7.",
    ),
    "capture.colour": Bound(
        0.505,
        "absolute",
        1.0,
        "Levels of 255 from the shaded colour before it is rounded: half a level, and what 40 roundings move it.",
    ),
    "capture.alpha": Bound(0.0, "absolute", 1.0, "Levels of 255."),
    "capture.bits": Bound(
        0.0,
        "absolute",
        1.0,
        "Words in which the sorted list differs from a second capture, from another shader's list sorted here, and on "
        "software drivers from the other driver's.",
    ),
    "refused.scenes": Bound(
        0.0, "absolute", 1.0, "Files with NaN or infinity that are not refused with a clear error."
    ),
    "abuffer-list": _ORDERED,
    "abuffer-array": _ORDERED,
    "sbuffer": _ORDERED,
    "depth-peeling": _ORDERED,
    "dual-depth-peeling": _ORDERED,
    "bounded": _picture(
        4e-6,
        "Core as the exact ones; the tail's `P = exp(-D)` with `D = sum -ln(1-a)`: `1 - a` loses 2^-25, which is "
        "7.6e-6 of `-ln(1 - 1/255)`, the same in every term, and `D exp(-D) <= .37`. The binned tails have it of the "
        "whole list: `T_core P = exp(-D)`. `paper` has light up to 2.",
    ),
    "bounded.limits": Bound(
        0.0,
        "absolute",
        1.0,
        "Pixels outside of `0 <= K <= n`, fragments above F (or unspent, where the technique uses its budget "
        "whole; as many as any pixel's next bin has, where cores are whole bins), numbers that are not finite.",
    ),
    "binned": _picture(4e-6, "The tail of a binned `bounded` technique, of all fragments."),
    "weighted-average": _picture(1e-6, "Sums of up to 100 fragments; `(1 - A/n)^n` multiplies a rounding by n."),
    "weighted-blended": _picture(2e-6, "Weights by depth have a few roundings each; their mean cancels their size."),
    "moment": _picture(
        3e-5, "Solving for a distribution from its moments amplifies their rounding, 1e-7, by some hundred."
    ),
    "moment.ill conditioned": _picture(
        2e-2,
        "Pixels of 3 or 4 fragments, and tight groups with fragments far away. Three points are on the edge of what "
        "four moments describe; where two of them are close, `h_2` is nothing but rounding and bias. Below 1e-3 but "
        "for one list of a thousand; 1.4e-2 was the worst of 170,000. The error is between the colours of that group.",
    ),
    "multilayer": _ORDERED,
    "adaptive": _picture(
        1e-5,
        "`T` is a product of `(255 - a) (1/255)`, which all drivers round alike, so that all remove the same nodes: "
        "two roundings a factor instead of one, up to 1e-7 a fragment, and `n T <= 94`.",
    ),
    "stochastic": _picture(5e-7, "The same samples by the same hash: only the mean's sums are rounded."),
    "wavelet": _picture(
        1e-5,
        "Sums of up to 100 absorbances, added and subtracted level by level: a few roundings of 2^-24 of an optical "
        "depth of up to 550, which the exponential damps.",
    ),
    "bevy": _ORDERED,
    "storm-rules": _ORDERED,
    "moment.arithmetic": _picture(
        1e-4, "The shader's arithmetic on lists that no camera sees, of depths from 1e-30 to 1e4 m."
    ),
    "moment.arithmetic, 3 fragments": _picture(2e-2, "As `moment.ill conditioned`."),
    "moment.arithmetic, clusters": _picture(
        2e-3, "Two groups, each within 1e-6 of its depth: the moments' rounding is as large as what tells it apart."
    ),
    "moment.arithmetic, one far behind": _picture(
        0.3,
        "A tight group and one faint fragment far behind: the moments do not say which fragment of the group is "
        "in front. What remains is an average of its colours: finite, and within them. 0.14 was the worst of 40,000.",
    ),
    "range": Bound(
        0.0,
        "absolute",
        1.0,
        "Tiles whose range of depths leaves out what a ray through the middle of a quarter of the tile meets, or "
        "reaches a twentieth farther than all of them.",
    ),
    "bins.kept": Bound(
        0.0,
        "absolute",
        1.0,
        "Words of 16 bits in which what is kept of depth bins differs from integer arithmetic: places are rounded "
        "operation by operation, bins add whole units and stop at 4,095.",
    ),
    "bins.counts": Bound(0.0, "absolute", 1.0, "Fragments by which the count of a bin, which ends at 255, is wrong."),
    "bins.luma": Bound(0.0, "absolute", 1.0, "Sums of luma, in whole units, that differ from integer arithmetic."),
    "features": Bound(8e-6, "relative", 1.0, "Features in GLSL of n, D and the tile's range, and the background."),
    "features.spread": Bound(
        1e-5, "absolute", 1.0, "The standard deviation: the root of a difference, 16 times what that is wrong by."
    ),
    "features.kept": Bound(0.0, "absolute", 1.0, "`front_b` and `mean_b`, in whole steps: what is kept as it is."),
    "predict.glsl": Bound(
        1e-5, "relative", 1.0, "The network in GLSL on the same float32 features: dot products of a few dozen terms."
    ),
    "predict.features": Bound(
        INFORMATION, "relative", 1.0, "The network of float64 features: what the features' error does to its outputs."
    ),
    "allocation": Bound(
        0.0,
        "absolute",
        1.0,
        "Bins by which a pixel's cut differs from that of the same algorithm in numpy, and fragments that its run has "
        "no room for: every operation is rounded by itself, so that nothing may.",
    ),
}
"""Fast path, without its driver -> bound, for up to 100 fragments per pixel."""

DEEP: Final[dict[str, Bound]] = {
    "moment": _picture(5e-5, "As above, and sums of 4096 terms."),
    "abuffer-list": _ORDERED_DEEP,
    "abuffer-array": _ORDERED_DEEP,
    "sbuffer": _ORDERED_DEEP,
    "multilayer": _ORDERED_DEEP,
    "bounded": _picture(
        2.5e-5,
        "As above; with F = 0 all 4096 fragments are in the tail's sums, which is as `weighted-average` has it. The "
        "exponents of binned tails, up to 60, are rounded three times: `180 x 2^-24 = 1.1e-5` of a weight.",
    ),
    "binned": _picture(2.5e-5, "The tail of a binned `bounded` technique, of all 4096 fragments."),
    "weighted-average": _picture(
        2.5e-5, "Sums of 4096 equal terms round in one direction for long: up to `n / 2 2^-24 = 1.2e-4` of them."
    ),
    "weighted-blended": _picture(1e-5, "The same; weights differ, so that roundings cancel."),
    "stochastic": _picture(1e-5, "Sums of 4096 terms."),
}
"""The same for 4096 fragments per pixel, where that differs."""


PATHS: Final = (
    *(name for name in BOUNDS if "," not in name and not name.startswith("bounded")),
    *("kbuffer", "kbuffer-dynamic", "kbuffer-importance", "kbuffer-deep", "kbuffer-temporal", "kbuffer-optimal"),
)
"""What rows are called, without what comes after a dot or the driver: the bounded techniques share their bounds."""


def bound_of(key: str, deep: bool) -> Bound:
    """The bound of a path.

    Args:
        key: Of `BOUNDS`.
        deep: Whether pixels have thousands of fragments.
    """
    return DEEP[key] if deep and key in DEEP else BOUNDS[key]
