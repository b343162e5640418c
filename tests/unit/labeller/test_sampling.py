"""Which pixels become rows."""

from __future__ import annotations

import numpy as np
import pytest
from pydantic import ValidationError

from labeller.sampling import Sampling, sample_pixels, stratified_sample, uniform_sample

N = np.repeat([1, 2, 9], [1000, 500, 50])


def test_the_stratified_sample_has_its_share_of_every_n() -> None:
    sample = stratified_sample(np.arange(len(N)), N, 0.2, seed=3)
    for value, count in ((1, 200), (2, 100), (9, 10)):
        assert abs(np.count_nonzero(N[sample] == value) - count) <= 1
    assert np.array_equal(sample, np.unique(sample))


def test_the_uniform_sample_draws_every_pixel_equally_often() -> None:
    drawn = np.zeros(50)
    for seed in range(2000):
        sample = uniform_sample(np.arange(50), 0.2, seed)
        assert len(sample) == 10
        assert (np.diff(sample) > 0).all()
        drawn[sample] += 1
    # 400 expected, standard deviation 18: six of them hold for all 50 with probability 1 - 1e-7.
    assert (abs(drawn - 400) < 108).all()


def test_the_kind_decides_and_the_seed_repeats() -> None:
    pixels = np.arange(len(N))
    stratified, uniform = Sampling(seed=4), Sampling(kind="uniform", seed=4)
    np.testing.assert_array_equal(sample_pixels(pixels, N, stratified), stratified_sample(pixels, N, 0.2, 4))
    np.testing.assert_array_equal(sample_pixels(pixels, N, uniform), uniform_sample(pixels, 0.2, 4))
    assert not np.array_equal(sample_pixels(pixels, N, uniform), sample_pixels(pixels, N, Sampling(kind="uniform")))


def test_everything_can_be_taken() -> None:
    for kind in ("stratified", "uniform"):
        sampling = Sampling(kind=kind, fraction=1.0)  # type: ignore[arg-type]
        np.testing.assert_array_equal(sample_pixels(np.arange(5), np.ones(5, int), sampling), np.arange(5))


@pytest.mark.parametrize("fraction", [0.0, 1.5, -1.0])
def test_a_share_is_above_0_and_at_most_1(fraction: float) -> None:
    with pytest.raises(ValidationError):
        Sampling(fraction=fraction)
