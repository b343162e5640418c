"""Sums and features against a plain float64 twin, and the GLSL against both."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from support.dumps import dump_of, random_dump

import renderer
from renderer.features import FEATURES, SUMS, derive, features_glsl, gather
from schemas.fragments import FragmentDump


def plain_sums(dump: FragmentDump) -> NDArray[np.float64]:
    """Raw sums, pixel by pixel as the definition says."""
    out = np.zeros((dump.pixels, len(SUMS)))
    for p in range(dump.pixels):
        part = slice(dump.offsets[p], dump.offsets[p + 1])
        rgba, z = dump.rgba[part] / 255.0, dump.depth[part].astype(np.float64)
        if not len(z):
            continue
        colour, a = rgba[:, :3], rgba[:, 3]
        x = (z - z.min()) / (z.max() - z.min()) if z.max() > z.min() else np.zeros(len(z))
        out[p, 0:4] = len(z), a.sum(), (a * a).sum(), -np.log(1.0 - a).sum()
        out[p, 4:7], out[p, 7] = colour.sum(axis=0), x.sum()
        out[p, 8:11], out[p, 11] = (colour * a[:, None]).sum(axis=0), (x * x).sum()
        out[p, 12:15], out[p, 15] = (colour * colour).sum(axis=0), z.min()
        out[p, 16:19], out[p, 19] = (colour * x[:, None]).sum(axis=0), z.max()
        out[p, 20:24], out[p, 24:27] = rgba[0], dump.background[p] / 255.0
    return out


def plain_features(dump: FragmentDump) -> NDArray[np.float64]:
    """Features from the fragments themselves, not from sums."""
    out = np.zeros((dump.pixels, len(FEATURES)))
    for p in range(dump.pixels):
        part = slice(dump.offsets[p], dump.offsets[p + 1])
        rgba, z = dump.rgba[part] / 255.0, dump.depth[part].astype(np.float64)
        if not len(z):
            continue
        colour, a = rgba[:, :3], rgba[:, 3]
        x = (z - z.min()) / (z.max() - z.min()) if z.max() > z.min() else np.zeros(len(z))
        values = {
            "log_n": math.log2(len(z)),
            "optical_depth": math.log1p(-np.log(1.0 - a).sum()),
            "alpha_mean": a.mean(),
            "alpha_std": a.std(),
            "alpha_nearest": a[0],
            "depth_mean": x.mean(),
            "depth_std": x.std(),
            "depth_extent": math.log(1e-4 + (z.max() - z.min()) / z.max()),
        }
        for i, c in enumerate("rgb"):
            values |= {
                f"rgb_mean_{c}": colour[:, i].mean(),
                f"rgb_alpha_{c}": (a * colour[:, i]).sum() / a.sum(),
                f"rgb_nearest_{c}": colour[0, i],
                f"background_{c}": dump.background[p, i] / 255.0,
                f"rgb_std_{c}": colour[:, i].std(),
                f"rgb_depth_cov_{c}": ((colour[:, i] - colour[:, i].mean()) * (x - x.mean())).mean(),
            }
        out[p] = [values.get(name, 0.0) for name in FEATURES]  # without depth bins there are no shares in front
    return out


def assert_features_close(actual: NDArray[np.float32], expected: NDArray[np.float64] | NDArray[np.float32]) -> None:
    """Spreads are square roots of float32 differences of sums: their squares are compared."""
    spread = [name.endswith("std") or "_std_" in name for name in FEATURES]
    assert np.abs(actual[:, spread] ** 2 - expected[:, spread] ** 2).max() < 2e-6
    rest = np.logical_not(spread)
    assert np.abs(actual[:, rest] - expected[:, rest]).max() < 1e-5


def test_sums_are_those_of_the_definition() -> None:
    dump = random_dump(37, 11, 20, seed=1)
    np.testing.assert_allclose(gather(dump), plain_sums(dump), rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("max_n", [1, 6, 300])
def test_features_are_those_of_the_fragments(max_n: int) -> None:
    dump = random_dump(16, 9, max_n, seed=2)
    assert_features_close(derive(gather(dump)), plain_features(dump))


def test_equal_depths_have_no_extent() -> None:
    rgba = np.array([[10, 20, 30, 1], [200, 100, 50, 254]], np.uint8)
    features = derive(gather(dump_of([(rgba, np.array([5.0, 5.0], np.float32))])))[0]
    named = dict(zip(FEATURES, features, strict=True))
    assert named["depth_mean"] == named["depth_std"] == 0.0
    assert named["depth_extent"] == pytest.approx(math.log(1e-4), rel=1e-6)
    assert named["rgb_depth_cov_r"] == 0.0


def test_extreme_depths_stay_finite() -> None:
    rgba = np.tile(np.array([[0, 255, 3, 128]], np.uint8), (2, 1))
    near_and_far = (rgba, np.array([1e-38, 3e38], np.float32))
    features = derive(gather(dump_of([near_and_far, near_and_far])))
    assert np.isfinite(features).all()


def test_pixels_without_fragments_are_zero() -> None:
    dump = random_dump(20, 20, 2, seed=3)
    empty = dump.counts == 0
    assert empty.any()
    sums = gather(dump)
    assert not sums[empty].any()
    assert not derive(sums)[empty].any()
    with_background = sums.copy()
    with_background[:, 24:27] = 0.5
    assert not derive(with_background)[empty].any()


def test_committed_glsl_is_the_generated_one() -> None:
    path = Path(renderer.__file__).parent / "shaders" / "common" / "features.glsl"
    assert path.read_text() == features_glsl(), "write features_glsl() to renderer/shaders/common/features.glsl"


def test_a_subset_holds_only_what_is_asked_for() -> None:
    text = features_glsl(("depth_std", "log_n"))
    assert "#define DIAPHANE_FEATURES 2" in text
    assert "x[0] = sqrt" in text
    assert "x[1] = log2" in text
    assert "rgb_mean" not in text


def test_an_unknown_feature_is_refused() -> None:
    with pytest.raises(KeyError):
        features_glsl(("log_n", "x[0]; discard"))
