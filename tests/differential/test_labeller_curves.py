"""Fast error curves and pictures against the plain float64 reference."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from support.curves import split
from support.dumps import dump_of, random_dump

from labeller import reference
from labeller.curves import composite, error_curves
from schemas.tail import METRICS, TAILS, MetricName, TailName

ALPHAS = np.array([0, 1, 128, 254], dtype=np.uint8)  # a dump has no 0; the arithmetic must survive it all the same


def stressed(
    n: int, seed: int, alpha: int | None = None, extent: float = 1.0
) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
    """One pixel with alphas from the extremes and depths from one plane to a span of many magnitudes."""
    rng = np.random.default_rng(seed)
    rgba = rng.integers(0, 256, (n, 4), dtype=np.uint8)
    rgba[:, 3] = rng.choice(ALPHAS, n) if alpha is None else alpha
    depth = np.sort(1.0 + extent * rng.random(n)).astype(np.float32)
    return rgba, depth


@pytest.mark.parametrize("tail", TAILS)
@pytest.mark.parametrize("metric", METRICS)
@pytest.mark.parametrize("g", [0.0, 0.75])
def test_curves_equal_the_reference(tail: TailName, metric: MetricName, g: float) -> None:
    dump = random_dump(9, 7, 12, seed=3)
    fast = error_curves(dump, tail, g, metric)
    for p, curve in enumerate(split(fast)):
        np.testing.assert_allclose(curve, reference.curve(dump, p, tail, g, metric), rtol=1e-6, atol=1e-15)


@pytest.mark.parametrize("tail", TAILS)
def test_pictures_equal_the_reference(tail: TailName) -> None:
    dump = random_dump(9, 7, 12, seed=4)
    k = np.random.default_rng(0).integers(0, 15, dump.pixels)
    picture = composite(dump, k, tail)
    for p in range(dump.pixels):
        pixel = reference.pixel_of(dump, p)
        np.testing.assert_allclose(
            picture[p], reference.composite(pixel, min(int(k[p]), pixel.n), tail), rtol=1e-6, atol=1e-7
        )


@pytest.mark.parametrize("tail", TAILS)
def test_extreme_lists_equal_the_reference(tail: TailName) -> None:
    lists = [
        *(stressed(n, seed=n) for n in (1, 2, 3, 64, 200)),
        *(stressed(40, seed=50 + int(alpha), alpha=int(alpha)) for alpha in (*ALPHAS, 255)),
        *(stressed(30, seed=90 + i, extent=extent) for i, extent in enumerate((0.0, 1e-6, 1e7, 1e30))),
    ]
    dump = dump_of(lists, background=(255, 0, 77))
    fast = error_curves(dump, tail)
    assert np.isfinite(fast.error).all()
    for p, curve in enumerate(split(fast)):
        np.testing.assert_allclose(curve, reference.curve(dump, p, tail), rtol=1e-5, atol=1e-12)


@pytest.mark.parametrize("alpha", [1, 128, 254])
def test_lists_of_4096_fragments_equal_the_reference_where_sampled(alpha: int) -> None:
    dump = dump_of([stressed(4096, seed=alpha, alpha=alpha)])
    fast = error_curves(dump).error
    pixel = reference.pixel_of(dump, 0)
    exact = reference.linear_to_srgb(reference.exact(pixel))
    for k in (0, 1, 7, 300, 2048, 4095):
        colour = reference.linear_to_srgb(reference.composite(pixel, k))
        assert fast[k] == pytest.approx(((colour - exact) ** 2).sum(), rel=1e-5, abs=1e-12)
    assert fast[4096] == 0.0


def test_denormal_depths_equal_the_reference() -> None:
    rgba, _ = stressed(12, seed=1)
    depth = (np.arange(1, 13) * np.float32(1e-45)).astype(np.float32)
    dump = dump_of([(rgba, depth)])
    np.testing.assert_allclose(error_curves(dump).error, reference.curve(dump, 0), rtol=1e-5, atol=1e-12)
