"""Sums and features against a plain float64 twin, and the GLSL against both."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from support.dumps import dump_of, random_dump

import renderer
from labeller import reference
from renderer.features import FEATURES, SUMS, derive, features_glsl, gather, reads_luma, sums_read
from schemas.fragments import FragmentDump
from schemas.problem import Problem
from schemas.tail import BINNED_TAILS, DEFAULT_TAIL, OPTICAL_UNIT, TAILS, TailName


def luma_sums(pixel: reference.Pixel, light: NDArray[np.float64]) -> tuple[float, float]:
    """Units times luma and times its square, each rounded to what a word counts in, as they are read."""
    units = np.maximum(1, np.round(light * OPTICAL_UNIT)).astype(int).tolist()
    luma = [math.floor((54 * r + 183 * g + 19 * b) / 256 + 0.5) for r, g, b in np.rint(255 * pixel.colour).astype(int)]
    first = min(sum(math.floor(u * y / 64 + 0.5) for u, y in zip(units, luma, strict=True)), 65535)
    second = min(sum(math.floor(u * y * y / 16384 + 0.5) for u, y in zip(units, luma, strict=True)), 65535)
    return 64 * first / 255 / OPTICAL_UNIT, 16384 * second / 65025 / OPTICAL_UNIT


def plain_sums(dump: FragmentDump, tail: TailName) -> NDArray[np.float64]:
    """Raw sums, pixel by pixel as the definition says."""
    out, row = np.zeros((dump.pixels, len(SUMS))), TAILS[tail]
    for p in np.flatnonzero(dump.counts):
        pixel = reference.pixel_of(dump, int(p), stored=True)
        light = -np.log(1.0 - pixel.alpha)
        bins, luma = reference.depth_bins(pixel, light, row), luma_sums(pixel, light)
        values = {
            "n": pixel.n,
            "optical_depth": bins.units / OPTICAL_UNIT,
            "z_near": pixel.nearest,
            "z_far": pixel.nearest + pixel.extent,
            "sum_luma": luma[0],
            "sum_luma2": luma[1],
            **{f"front_{b}": bins.front[b] for b in range(1, row.bins)},
            **({f"mean_{b}": bins.mean[b - 1] for b in range(1, row.bins)} if row.mean_levels else {}),
        }
        values |= {f"background_{c}": pixel.background[i] for i, c in enumerate("rgb")}
        out[p] = [values.get(name, 0.0) for name in SUMS]
    return out


def plain_features(dump: FragmentDump, tail: TailName) -> NDArray[np.float64]:
    """Features from the fragments themselves, not from sums."""
    out, row = np.zeros((dump.pixels, len(FEATURES))), TAILS[tail]
    for p in np.flatnonzero(dump.counts):
        pixel = reference.pixel_of(dump, int(p), stored=True)
        light = -np.log(1.0 - pixel.alpha)
        bins = reference.depth_bins(pixel, light, row)
        optical = bins.units / OPTICAL_UNIT
        mean, square = (each / optical for each in luma_sums(pixel, light))
        far = pixel.nearest + pixel.extent
        values = {
            "log_n": math.log2(pixel.n),
            "optical_depth": math.log1p(optical),
            "luma_mean": mean,
            "luma_std": math.sqrt(max(0.001, square - mean**2)),
            "depth_extent": math.log(1e-4 + pixel.extent / far),
            **{f"front_{b}": bins.front[b] for b in range(1, row.bins)},
            **({f"mean_{b}": bins.mean[b - 1] for b in range(1, row.bins)} if row.mean_levels else {}),
        }
        values |= {f"background_{c}": pixel.background[i] for i, c in enumerate("rgb")}
        out[p] = [values.get(name, 0.0) for name in FEATURES]
    return out


def assert_features_close(actual: NDArray[np.float32], expected: NDArray[np.float64]) -> None:
    """Spreads are square roots of float32 differences of sums: their squares are compared."""
    spread = ["_std" in name for name in FEATURES]
    assert np.abs(actual[:, spread] ** 2 - expected[:, spread] ** 2).max() < 2e-6
    rest = np.logical_not(spread)
    assert np.abs(actual[:, rest] - expected[:, rest]).max() < 1e-5


@pytest.mark.parametrize("tail", BINNED_TAILS)
def test_sums_are_those_of_the_definition(tail: TailName) -> None:
    dump = random_dump(37, 11, 20, seed=1)
    np.testing.assert_allclose(gather(dump, tail), plain_sums(dump, tail), rtol=2e-6, atol=2e-6)


@pytest.mark.parametrize("tail", BINNED_TAILS)
@pytest.mark.parametrize("max_n", [1, 6, 300])
def test_features_are_those_of_the_fragments(tail: TailName, max_n: int) -> None:
    dump = random_dump(16, 9, max_n, seed=2)
    assert_features_close(derive(gather(dump, tail)), plain_features(dump, tail))


def test_equal_depths_have_no_extent() -> None:
    rgba = np.array([[10, 20, 30, 1], [200, 100, 50, 254]], np.uint8)
    features = derive(gather(dump_of([(rgba, np.array([5.0, 5.0], np.float32))]), DEFAULT_TAIL))[0]
    named = dict(zip(FEATURES, features, strict=True))
    assert named["depth_extent"] == pytest.approx(math.log(1e-4), rel=1e-6)


def test_extreme_depths_stay_finite() -> None:
    rgba = np.tile(np.array([[0, 255, 3, 128]], np.uint8), (2, 1))
    near_and_far = (rgba, np.array([1e-38, 3e38], np.float32))
    features = derive(gather(dump_of([near_and_far, near_and_far]), DEFAULT_TAIL))
    assert np.isfinite(features).all()


def test_pixels_without_fragments_are_zero() -> None:
    dump = random_dump(20, 20, 2, seed=3)
    empty = dump.counts == 0
    assert empty.any()
    sums = gather(dump, DEFAULT_TAIL)
    assert not sums[empty].any()
    assert not derive(sums)[empty].any()
    with_background = sums.copy()
    with_background[:, SUMS.index("background_r") : SUMS.index("background_b") + 1] = 0.5
    assert not derive(with_background)[empty].any()


def test_committed_glsl_is_the_generated_one() -> None:
    path = Path(renderer.__file__).parent / "shaders" / "common" / "features.glsl"
    assert path.read_text() == features_glsl(), "write features_glsl() to renderer/shaders/common/features.glsl"


def test_a_subset_holds_only_what_is_asked_for() -> None:
    text = features_glsl(("luma_std", "log_n"))
    assert "#define DIAPHANE_FEATURES 2" in text
    assert "x[0] = sqrt" in text
    assert "x[1] = log2" in text
    assert "luma_mean" not in text


@pytest.mark.parametrize("tail", [tail for tail in TAILS if tail not in BINNED_TAILS])
def test_a_tail_without_bins_has_no_features(tail: TailName) -> None:
    with pytest.raises(Problem, match=f"no features of the tail {tail}"):
        gather(random_dump(4, 4, 3, seed=1), tail)


def test_an_unknown_feature_is_refused() -> None:
    with pytest.raises(KeyError):
        features_glsl(("log_n", "x[0]; discard"))


def test_what_features_read_follows_from_their_formulas() -> None:
    assert sums_read(("log_n", "optical_depth")) == {"n", "optical_depth"}
    assert sums_read(("depth_extent",)) == {"z_near", "z_far"}
    assert not reads_luma(("log_n", "background_r", "front_3", "mean_2", "depth_extent"))
    for name in ("luma_mean", "luma_std"):
        assert reads_luma((name,))
