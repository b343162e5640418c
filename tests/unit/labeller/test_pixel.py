"""Single pixels by prefix sums against the plain reference, and their hulls against those of whole views."""

from __future__ import annotations

import numpy as np
import pytest
from support.dumps import random_dump

from labeller import pixel, reference
from labeller.curves import error_curves
from labeller.hull import lower_hulls
from schemas.tail import METRICS, TAILS, MetricName, TailName

DUMP = random_dump(6, 5, 24, seed=11)


@pytest.mark.parametrize("metric", METRICS)
@pytest.mark.parametrize("tail", TAILS)
def test_curves_are_those_of_the_reference(tail: TailName, metric: MetricName) -> None:
    for p in range(DUMP.pixels):
        one = reference.pixel_of(DUMP, p, stored=metric == "paper")
        found = pixel.errors(pixel.colours(one, tail, 0.6), metric)
        np.testing.assert_allclose(found, reference.curve(DUMP, p, tail, 0.6, metric), rtol=1e-5, atol=1e-12)


def test_an_opaque_and_an_invisible_list_have_colours() -> None:
    dump = random_dump(3, 3, 4, seed=2, alpha=1.0)
    for p in range(dump.pixels):
        one = reference.pixel_of(dump, p)
        for k, colour in enumerate(pixel.colours(one, "density-16")):
            np.testing.assert_allclose(colour, reference.composite(one, k, "density-16"), atol=1e-12)


def test_hulls_are_those_of_the_view() -> None:
    curves = error_curves(DUMP, "density")
    hulls = lower_hulls(curves)
    for p in range(DUMP.pixels):
        curve = curves.error[curves.offsets[p] : curves.offsets[p + 1]]
        assert pixel.hull(curve) == hulls.k[hulls.offsets[p] : hulls.offsets[p + 1]].tolist()
