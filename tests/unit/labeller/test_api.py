"""`labeller.allocate` on plain arrays: what it gives, and what it says of arrays that it cannot use."""

from __future__ import annotations

import doctest
from typing import Any

import numpy as np
import pytest
from support.dumps import random_dump

import labeller
from labeller import api
from labeller.curves import error_curves
from labeller.rules import allocate_curves
from schemas.fragments import FragmentDump
from schemas.problem import ExitCode, Problem

DUMP = random_dump(12, 9, 7, seed=3)


def arrays(dump: FragmentDump = DUMP) -> dict[str, Any]:
    return {
        "counts": dump.counts.reshape(dump.height, dump.width),
        "rgba": dump.rgba,
        "depth": dump.depth,
        "background": dump.background.reshape(dump.height, dump.width, 3),
        "facing": dump.facing,
    }


@pytest.mark.parametrize("rule", labeller.RULES)
def test_plain_arrays_give_what_a_dump_gives(rule: labeller.RuleName) -> None:
    budgets = [0, DUMP.total // 3, DUMP.total]
    known = allocate_curves(DUMP, error_curves(DUMP), budgets, rule)
    offsets = {**arrays(), "offsets": DUMP.offsets, "shape": (DUMP.height, DUMP.width)}
    del offsets["counts"]
    for fragments in (DUMP, arrays(), offsets):
        for found, expected in zip(labeller.allocate(fragments, budgets, rule), known, strict=True):
            assert np.array_equal(found.k, expected.k)
            assert (found.error, found.bound, found.budget) == (expected.error, expected.bound, expected.budget)


def test_what_is_left_out_has_the_value_that_is_documented() -> None:
    given = {name: arrays()[name] for name in ("counts", "rgba", "depth")}
    white = np.full((DUMP.pixels, 3), 255, np.uint8)
    full = {**given, "background": white, "facing": np.full(DUMP.pixels, 255, np.uint8)}
    for rule in labeller.RULES:
        (short,), (whole,) = (labeller.allocate(x, DUMP.total // 2, rule) for x in (given, full))
        assert np.array_equal(short.k, whole.k)
    row = {**given, "counts": DUMP.counts}
    assert api.fragments_of(row).height == 1


def test_the_example_of_the_documentation_is_true() -> None:
    assert doctest.testmod(api).attempted > 0
    assert doctest.testmod(api).failed == 0


def test_budgets_of_numpy_and_lists_of_python_are_fine() -> None:
    lists = {
        name: np.asarray(value).tolist()
        for name, value in arrays().items()
        if name not in ("rgba", "background", "facing")
    }
    (a,) = labeller.allocate({**lists, "rgba": DUMP.rgba}, np.int64(20))
    (b,) = labeller.allocate({**lists, "rgba": DUMP.rgba}, np.array([20], dtype=np.uint16))
    assert np.array_equal(a.k, b.k)


def test_budgets_may_come_one_by_one() -> None:
    given = labeller.allocate(DUMP, [9, 30])
    for budgets in ((x for x in (9, 30)), np.array([9, 30], ">u2"), range(9, 31, 21)):
        assert [x.k.tolist() for x in labeller.allocate(DUMP, budgets)] == [x.k.tolist() for x in given]


def test_arrays_of_other_layouts_give_the_same_and_stay_as_they_are() -> None:
    strided = np.zeros((2 * DUMP.total, 8), np.uint8)
    strided[::2, ::2] = DUMP.rgba
    given = {
        "offsets": DUMP.offsets.astype(np.uint64),
        "rgba": strided[::2, ::2],
        "depth": DUMP.depth.astype(">f8"),
        "background": np.asfortranarray(DUMP.background),
        "facing": DUMP.facing[::-1][::-1],
        "shape": np.array([DUMP.height, DUMP.width], dtype=">i2"),
    }
    before = {name: value.copy() for name, value in given.items()}
    for value in given.values():
        value.flags.writeable = False
    weights = np.linspace(1.0, 2.0, DUMP.pixels).astype(np.float16)
    for rule in labeller.RULES:
        ((found,), (expected,)) = (labeller.allocate(x, 40, rule, weights=weights) for x in (given, DUMP))
        assert np.array_equal(found.k, expected.k)
    assert all(np.array_equal(value, before[name]) for name, value in given.items())


def test_the_optimum_leaves_pixels_to_their_tail_where_algorithm_1_does_not() -> None:
    budget = int(1.2 * np.count_nonzero(DUMP.counts))
    ((dhoit,), (best,)) = (labeller.allocate(DUMP, [budget], rule) for rule in ("greedy", "optimal"))
    assert (dhoit.k >= np.minimum(DUMP.counts, 1)).all()
    assert (best.k[DUMP.counts > 0] == 0).any()
    assert best.error < dhoit.error


def test_a_weight_moves_fragments_to_where_it_is() -> None:
    budget = DUMP.total // 3
    left = np.zeros((DUMP.height, DUMP.width), bool)
    left[:, : DUMP.width // 2] = True
    (plain,) = labeller.allocate(DUMP, [budget])
    (moved,) = labeller.allocate(DUMP, [budget], weights=np.where(left, 100.0, 1.0))
    assert moved.k[left.reshape(-1)].sum() > plain.k[left.reshape(-1)].sum()
    (only,) = labeller.allocate(DUMP, [budget], weights=np.where(left, 1.0, 0.0))
    assert only.k[~left.reshape(-1)].max() <= 1


def drop(*names: str) -> dict[str, Any]:
    return {name: value for name, value in arrays().items() if name not in names}


def changed(name: str, value: Any) -> dict[str, Any]:
    return {**arrays(), name: value}


RISING = DUMP.depth.copy()
RISING[DUMP.offsets[:-1][DUMP.counts > 1][0]] = 1e9
OPAQUE = DUMP.rgba.copy()
OPAQUE[3, 3] = 255
NAN = np.full_like(DUMP.depth, np.nan)


@pytest.mark.parametrize(
    ("fragments", "says"),
    [
        (drop("rgba"), "have background, counts, depth, facing"),
        (drop("counts"), "either counts or offsets"),
        ({**arrays(), "offsets": DUMP.offsets}, "either counts or offsets"),
        ({**arrays(), "colour": 1}, "colour"),
        ({}, "no arrays"),
        (changed("depth", DUMP.depth[:-1]), "depth has the shape"),
        (changed("depth", RISING), "depths of a pixel fall"),
        (changed("depth", NAN), "not positive numbers"),
        (changed("depth", DUMP.depth.astype(str)), "depth is of type"),
        (changed("depth", -DUMP.depth[::-1]), "."),
        (changed("rgba", DUMP.rgba / 255.0), "rgba is of type float64"),
        (changed("rgba", DUMP.rgba[:, :3]), "rgba has the shape"),
        (changed("rgba", OPAQUE), "alpha 255"),
        (changed("counts", DUMP.counts + 0.5), "counts is of type float64"),
        (changed("counts", -DUMP.counts), "counts does not say"),
        (changed("counts", [[1], [2, 3]]), "counts is not an array"),
        (changed("counts", [2**62] * 4 + [DUMP.total]), "counts does not say"),
        (changed("counts", np.ma.array(DUMP.counts, mask=DUMP.counts > 1)), "counts has masked entries"),
        (changed("rgba", np.ma.array(DUMP.rgba, mask=DUMP.rgba > 9)), "rgba has masked entries"),
        (changed("depth", DUMP.depth.astype(np.float64) * 1e300), "not positive numbers"),
        (changed("shape", (9.0, 12.0)), "has no integers"),
        (changed("shape", "9x12"), "has no integers"),
        (changed("background", 255), "background has the shape ()"),
        (changed("background", []), "background has the shape (0,)"),
        (changed("background", DUMP.background.reshape(12, 9, 3)), "background has the shape (12, 9, 3)"),
        ({**arrays(), 3: 1}, "have 3, background"),
        ([DUMP.rgba], "of type list"),
        (changed("shape", (5, 5)), "The shape (5, 5) is not that of 108 pixels"),
        (changed("background", np.zeros((3, 3), np.uint8)), "background has the shape"),
        (changed("facing", np.zeros(DUMP.pixels)), "facing is of type"),
    ],
)
def test_arrays_that_do_not_fit_are_refused_by_name(fragments: dict[str, Any], says: str) -> None:
    with pytest.raises(Problem) as found:
        labeller.allocate(fragments, [10])
    assert says in str(found.value)
    assert found.value.remedy


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ({"rule": "best"}, "no rule 'best'"),
        ({"tail": "none"}, "no tail 'none'"),
        ({"metric": "ssim"}, "no metric 'ssim'"),
        ({"fill": "even"}, "no fill 'even'"),
        ({"rule": np.array(["greedy", "fixed"])}, "no rule"),
        ({"vkb": None}, "vkb is of type NoneType"),
        ({"g": "steep"}, "g is"),
        ({"g": [0.5, 1.0]}, "g is"),
        ({"g": "steep", "tail": "paper"}, "g is"),
        ({"g": -1.0}, "g is"),
        ({"g": float("nan")}, "g is"),
        ({"weights": np.ones(3)}, "3 weights for 108 pixels"),
        ({"weights": np.full(108, -1.0)}, "weights"),
        ({"weights": np.full(108, np.inf)}, "weights"),
        ({"weights": np.full(108, 1e-30)}, "1e-9"),
        ({"weights": ["a"] * 108}, "weights is of type"),
        ({"weights": np.ones((12, 9))}, "weights has the shape (12, 9)"),
        ({"weights": np.ma.array(np.ones(108), mask=np.arange(108) > 50)}, "weights has masked entries"),
        ({"budgets": [True]}, "not a whole number"),
        ({"budgets": "12"}, "not a whole number"),
        ({"budgets": np.array([[1, 2]])}, "not a whole number"),
        ({"budgets": np.ma.array([1, 2], mask=[True, False])}, "masked"),
        ({"budgets": [-1]}, "negative"),
        ({"budgets": [1.5]}, "not a whole number"),
    ],
)
def test_arguments_that_make_no_sense_are_refused(arguments: dict[str, Any], says: str) -> None:
    with pytest.raises(Problem) as found:
        labeller.allocate(DUMP, **{"budgets": [10], **arguments})
    assert says in str(found.value)
    assert found.value.code == ExitCode.USAGE
