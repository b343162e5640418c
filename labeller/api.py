"""`labeller.allocate`: the whole labeller as one function of plain numpy arrays, for use on its own."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from operator import index
from typing import Any, Final, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from labeller.allocation import RULES, Allocation, RuleName
from labeller.baselines import FillName
from labeller.curves import error_curves
from labeller.rules import allocate_curves
from renderer.allocation.importance import VkbOptions
from schemas.fragments import FragmentDump
from schemas.problem import ExitCode, Problem
from schemas.tail import DEFAULT_TAIL, DENSITY_G, METRICS, TAILS, MetricName, TailName

_VKB: Final = VkbOptions()
_REQUIRED: Final = ("rgba", "depth")
_OPTIONAL: Final = ("offsets", "counts", "background", "facing", "shape")


def allocate(
    fragments: FragmentDump | Mapping[str, ArrayLike],
    budgets: Iterable[int] | int,
    rule: RuleName = "optimal",
    *,
    tail: TailName = DEFAULT_TAIL,
    g: float = DENSITY_G,
    metric: MetricName = "display",
    weights: ArrayLike | None = None,
    vkb: VkbOptions = _VKB,
    fill: FillName = "exact",
) -> list[Allocation]:
    """How many core fragments every pixel deserves, for each budget (METHOD section 3).

    Examples:
        >>> import labeller, numpy as np
        >>> rgba = np.array([[200, 40, 40, 128], [40, 200, 40, 128], [40, 40, 200, 128]], np.uint8)
        >>> fragments = {"counts": [3], "rgba": rgba, "depth": [1.0, 2.0, 3.0]}
        >>> [x.k.tolist() for x in labeller.allocate(fragments, [1, 2, 3], tail="density")]
        [[1], [2], [3]]

    Args:
        fragments: A view, as `renderer.capture` or `renderer.dump.read_dump` give it, or a mapping of arrays with P
            pixels and N fragments:

            - `counts`: integers [P] or [H, W], fragments of each pixel; or `offsets`: integers [P+1], those of pixel p
              are `offsets[p]:offsets[p+1]`. Row 0 is at the top.
            - `rgba`: uint8 [N, 4], straight alpha; RGB gamma-2 encoded (`linear = (stored / 255)^2`), alpha linear
              and not 255, front to back within a pixel.
            - `depth`: [N], view-space distance, > 0, not falling within a pixel, in any one unit.
            - `background` (white): uint8 [P, 3] or [3], gamma-2 encoded colour of what lies behind.
            - `facing` (255): uint8 [P], |n . e| * 255 of the nearest fragment, for rule `importance`.
            - `shape` (one row, or that of `counts`): (H, W), for rule `importance` and the binned tails, whose bins
              lie between the ends of tiles.
        budgets: Fragment counts F >= 0, in any order; F >= N gives k = n, flagged `exact`.
        rule: One of `labeller.RULES`: `optimal` (certified), `greedy` (DHOIT, Algorithm 1), `increment`, `fixed`,
            `dynamic` (k+-buffer), `importance` (VKB), `uniform`, `proportional`.
        tail: What stands for the fragments beyond k: one of `schemas.tail.TAILS` (METHOD section 2).
        g: Steepness of the density tail.
        metric: Space of the squared error, which is summed over RGB: `display` (sRGB, clamped), `linear` or `paper`.
        weights: [P] or [H, W], >= 0: what a pixel's error counts, such as a saliency map; None: every pixel counts 1.
        vkb: Factors of rule `importance`.
        fill: How `importance`, `uniform` and `proportional` come from weights to counts.

    Returns:
        One `labeller.Allocation` for each budget, in their order: `k` int32 [P], its `error`, and for rule
        `optimal` a lower `bound` of every allocation's error.

    Raises:
        Problem: An argument cannot be used; it says which and what to give instead.
    """
    _one_of("rule", rule, RULES)
    _one_of("tail", tail, tuple(TAILS))
    _one_of("metric", metric, METRICS)
    _one_of("fill", fill, get_args(FillName))
    if not isinstance(vkb, VkbOptions):
        raise _wrong(f"vkb is of type {type(vkb).__name__}.", "Give renderer.allocation.importance.VkbOptions.")
    wanted = budgets_of(budgets)
    dump = fragments if isinstance(fragments, FragmentDump) else fragments_of(fragments)
    curves = error_curves(dump, tail, g, metric, None if weights is None else _weights(weights, dump))
    return allocate_curves(dump, curves, wanted, rule, vkb=vkb, fill=fill)


def fragments_of(arrays: Mapping[str, ArrayLike]) -> FragmentDump:
    """A view of plain arrays, checked.

    Args:
        arrays: As of `allocate`.

    Raises:
        Problem: One is missing, has the wrong shape or type, or is not in order; it says which.
    """
    if not isinstance(arrays, Mapping):
        raise _wrong(f"The fragments are of type {type(arrays).__name__}.", "Give a view or a dict of arrays.")
    unknown = set(arrays) - {*_REQUIRED, *_OPTIONAL}
    missing = [name for name in _REQUIRED if name not in arrays]
    if unknown or missing or ("counts" in arrays) == ("offsets" in arrays):
        raise _wrong(
            f"The fragments have {', '.join(sorted(map(str, arrays))) or 'no arrays'}.",
            "Give rgba, depth, either counts or offsets, and if you like background, facing and shape.",
        )
    offsets, shape = _lists(arrays)
    pixels, total = len(offsets) - 1, int(offsets[-1])
    rgba = _array("rgba", arrays["rgba"], np.uint8, (total, 4))
    depth = _array("depth", arrays["depth"], np.float32, (total,))
    if not (np.isfinite(depth).all() and depth.min(initial=1.0) > 0.0):
        raise _wrong(
            "There are depths that are not positive numbers in float32.",
            "Give distances from the camera, without NaN or infinity.",
        )
    first = np.zeros(total + 1, dtype=bool)
    first[offsets[:-1]] = True
    if total and bool(((np.diff(depth) < 0.0) & ~first[1:-1]).any()):
        raise _wrong("The depths of a pixel fall.", "Sort every pixel's fragments front to back.")
    if total and int(rgba[:, 3].max()) == 255:
        raise _wrong(
            "There are fragments of alpha 255, which are opaque.",
            "Make them the pixel's background, and leave out what lies behind them.",
        )
    background = _given("background", arrays.get("background", np.full(3, 255, dtype=np.uint8)))
    if background.shape == (3,):
        background = np.broadcast_to(background, (pixels, 3))
    return FragmentDump(
        width=shape[1],
        height=shape[0],
        offsets=offsets,
        rgba=rgba,
        depth=depth,
        background=_array("background", _by_pixel(background, shape, 3), np.uint8, (pixels, 3)),
        facing=_array(
            *("facing", _by_pixel(_given("facing", arrays.get("facing", np.full(pixels, 255, np.uint8))), shape)),
            *(np.uint8, (pixels,)),
        ),
    )


def _lists(arrays: Mapping[str, ArrayLike]) -> tuple[NDArray[np.int64], tuple[int, int]]:
    """Offsets of the pixels' lists, and the picture's height and width."""
    name = "counts" if "counts" in arrays else "offsets"
    given = _given(name, arrays[name])
    if given.size and given.dtype.kind not in "iu":
        raise _wrong(f"{name} is of type {given.dtype}.", "Give integers.")
    if name == "counts":
        offsets = np.concatenate([np.zeros(1, np.int64), np.cumsum(given.reshape(-1), dtype=np.int64)])
        shape = given.shape if given.ndim == 2 else (1, given.size)
    else:
        offsets = given.astype(np.int64).reshape(-1)
        shape = (1, max(len(offsets) - 1, 0))
    # What overflows int64 turns negative first.
    rises = len(offsets) > 0 and offsets[0] == 0 and offsets.min() == 0 and bool((np.diff(offsets) >= 0).all())
    if not rises or (name == "offsets" and given.ndim != 1):
        raise _wrong(
            f"{name} does not say where lists begin and end.", "Give counts >= 0, or offsets that rise from 0."
        )
    if "shape" in arrays:
        try:
            shape = tuple(index(x) for x in _given("shape", arrays["shape"]).reshape(-1))
        except TypeError as error:
            raise _wrong(f"The shape {arrays['shape']!r} has no integers.", "Give (height, width).") from error
    if len(shape) != 2 or min(shape) < 0 or shape[0] * shape[1] != len(offsets) - 1:
        raise _wrong(f"The shape {shape} is not that of {len(offsets) - 1} pixels.", "Give (height, width).")
    return offsets, (shape[0], shape[1])


def _given(name: str, given: ArrayLike) -> NDArray[Any]:
    if np.ma.is_masked(given):
        raise _wrong(f"{name} has masked entries.", "Give an array without a mask: fill them, or leave them out.")
    try:
        return np.asarray(given)
    except (TypeError, ValueError) as error:
        raise _wrong(f"{name} is not an array: {error}.", "Give an array, or lists of equal lengths.") from error


def _by_pixel(given: NDArray[Any], shape: tuple[int, int], axes: int = 2) -> NDArray[Any]:
    """An array of so many axes, the first two of them a picture's, with the pixels in one row; others as they are."""
    rows = given.shape[:2]
    # Where the height was left out, any rows of so many pixels will do.
    if given.ndim != axes or rows[0] * rows[1] != shape[0] * shape[1] or (shape[0] != 1 and rows != shape):
        return given
    return given.reshape(rows[0] * rows[1], *given.shape[2:])


def _weights(given: ArrayLike, dump: FragmentDump) -> NDArray[np.float64]:
    weights = _by_pixel(_given("weights", given), (dump.height, dump.width))
    if weights.dtype.kind not in "fiub":
        raise _wrong(f"weights is of type {weights.dtype}.", "Give numbers.")
    if weights.ndim > 1:
        raise _wrong(f"weights has the shape {weights.shape}.", f"Give one of {(dump.height, dump.width)}.")
    return weights.astype(np.float64).reshape(-1)


def _array(name: str, given: ArrayLike, dtype: type[np.generic], shape: tuple[int, ...]) -> NDArray[Any]:
    array = _given(name, given)
    if array.shape != shape:
        raise _wrong(f"{name} has the shape {array.shape}.", f"Give one of {shape}: what the lists' lengths ask for.")
    if dtype is np.uint8 and array.dtype != np.uint8:
        raise _wrong(f"{name} is of type {array.dtype}.", "Give uint8: stored values from 0 to 255.")
    if dtype is not np.uint8 and array.dtype.kind not in "fiu":
        raise _wrong(f"{name} is of type {array.dtype}.", "Give numbers.")
    with np.errstate(over="ignore"):  # what float32 cannot hold becomes infinite, and is refused as such
        return np.ascontiguousarray(array, dtype=dtype)


def budgets_of(budgets: Iterable[int] | int) -> list[int]:
    """Budgets, checked.

    Args:
        budgets: Fragment counts, one or several, integers of Python or numpy.

    Raises:
        Problem: One is no integer, or negative.
    """
    if np.ma.is_masked(budgets):
        raise _wrong("The budgets have masked entries.", "Give an array without a mask.")
    try:
        several = np.atleast_1d(budgets) if isinstance(budgets, np.ndarray) else budgets
        given = list(several) if isinstance(several, Iterable) else [several]
        wanted = [index(budget) for budget in given]
    except (TypeError, ValueError) as error:
        raise _wrong(f"A budget is not a whole number: {budgets}.", "Give integers: numbers of fragments.") from error
    if any(isinstance(budget, bool) for budget in given):
        raise _wrong(f"A budget is not a whole number: {budgets}.", "Give integers: numbers of fragments.")
    if any(budget < 0 for budget in wanted):
        raise _wrong(f"A budget is negative: {min(wanted)}.", "Give numbers of fragments, 0 or more.")
    return wanted


def _one_of(what: str, name: str, names: Sequence[str]) -> None:
    if not isinstance(name, str) or name not in names:
        raise _wrong(f"There is no {what} '{name}'.", f"Use one of {', '.join(names)}.")


def _wrong(title: str, remedy: str) -> Problem:
    return Problem(title, remedy, ExitCode.USAGE)
