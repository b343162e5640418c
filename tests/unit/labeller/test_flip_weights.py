"""Weights by FLIP: what they are, where they are nothing, and that an allocation with them looks better."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from support.dumps import random_dump

from labeller.curves import composite, error_curves
from labeller.flip_weights import MOST, UNSEEN_ERROR, UNSEEN_FLIP, flip_weights
from labeller.rules import allocate_curves
from renderer import metrics
from renderer.reference.flip import flip
from schemas.colour import display8, linear_to_srgb
from schemas.fragments import FragmentDump

DUMP = random_dump(40, 32, 10, seed=8)
OPEN = DUMP.counts > 1
CURVES = error_curves(DUMP)
BUDGETS = [DUMP.pixels, 2 * DUMP.pixels]
KEPT = [found.k for found in allocate_curves(DUMP, CURVES, BUDGETS, "optimal")]


def flip_of(dump: FragmentDump, k: NDArray[np.integer]) -> float:
    shown, exact = (display8(composite(dump, kept)).reshape(dump.height, -1, 3) for kept in (k, dump.counts))
    return metrics.flip(shown, exact)[0]


@pytest.mark.parametrize("kept", [KEPT[:1], KEPT])
def test_weights_are_positive_and_one_on_average(kept: list[NDArray[np.int32]]) -> None:
    weights = flip_weights(DUMP, kept)
    assert weights.shape == (DUMP.pixels,)
    assert weights[OPEN].mean() == pytest.approx(1.0)
    assert (weights[~OPEN] == 1.0).all()
    assert weights.min() > 0.0
    assert np.ptp(weights[OPEN]) > 0.5
    middle = np.median(flip_weights(DUMP, kept[:1])[OPEN])
    assert flip_weights(DUMP, kept[:1])[OPEN].max() <= MOST * middle * (1.0 + 1e-9)


def test_a_weight_is_what_flip_makes_of_a_squared_error() -> None:
    """The plain form: one pixel after the other."""
    shown, exact = composite(DUMP, KEPT[0]), composite(DUMP, DUMP.counts)
    seen = flip(display8(shown).reshape(DUMP.height, -1, 3), display8(exact).reshape(DUMP.height, -1, 3))
    slopes = {}
    for p in np.flatnonzero(OPEN).tolist():
        squared = sum((linear_to_srgb(shown[p, c]) - linear_to_srgb(exact[p, c])) ** 2 for c in range(3))
        slopes[p] = (seen[p // DUMP.width, p % DUMP.width] + UNSEEN_FLIP) / (squared + UNSEEN_ERROR)
    middle = float(np.median(list(slopes.values())))
    clipped = {p: min(max(slope, middle / MOST), middle * MOST) for p, slope in slopes.items()}
    mean = sum(clipped.values()) / len(clipped)
    found = flip_weights(DUMP, KEPT[:1])
    for p, slope in clipped.items():
        assert found[p] == pytest.approx(slope / mean, rel=1e-5)


def test_several_pictures_weigh_alike() -> None:
    each = np.mean([flip_weights(DUMP, [k]) for k in KEPT], axis=0)
    np.testing.assert_allclose(flip_weights(DUMP, KEPT), each, rtol=1e-12)


def test_without_a_picture_or_a_difference_all_weigh_the_same() -> None:
    assert (flip_weights(DUMP, []) == 1.0).all()
    assert flip_weights(DUMP, [DUMP.counts]) == pytest.approx(np.ones(DUMP.pixels))
    assert (flip_weights(random_dump(20, 20, 1, seed=1), [np.zeros(400, np.int32)]) == 1.0).all()


def test_the_optimum_of_weighted_errors_looks_better() -> None:
    ratios = []
    for seed in (8, 9, 10):
        dump = random_dump(48, 40, 10, seed=seed)
        usual = error_curves(dump)
        budgets = [dump.pixels, 2 * dump.pixels]
        kept = [found.k for found in allocate_curves(dump, usual, budgets, "optimal")]
        weighted = error_curves(dump, weights=flip_weights(dump, kept))
        for before, after in zip(kept, allocate_curves(dump, weighted, budgets, "optimal"), strict=True):
            ratios.append(flip_of(dump, after.k) / flip_of(dump, before))
            assert usual.total(after.k) >= usual.total(before), "the optimum without weights has the least errors"
    assert np.exp(np.mean(np.log(ratios))) < 0.99
