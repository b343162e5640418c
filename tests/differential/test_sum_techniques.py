"""The techniques that blend into sums, each in the frame against its float64 twin on the same fragments."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import moderngl
import numpy as np
import pytest
from numpy.typing import NDArray
from support.scenes import SIZE, VIEW, shells

from evaluation.stress import gl_stacks as stacks
from labeller.curves import composite
from renderer.capture import capture
from renderer.frame import Frame
from renderer.gpu_scene import GpuScene
from renderer.reference import moment, stochastic, wavelet, weighted_average, weighted_blended
from renderer.techniques import (
    Budget,
    Moment,
    Stochastic,
    Technique,
    Wavelet,
    WeightedAverage,
    WeightedBlended,
    technique,
)
from renderer.techniques.skips import EMPTY_TILES
from schemas.fragments import FragmentDump
from schemas.limits import LIMITS
from schemas.problem import Problem

Twin = Callable[[FragmentDump], NDArray[np.float64]]

UNUSED = Budget(0)
NEAR, FAR = VIEW.clip_range(shells().bounds)


def blended(equation: int) -> Twin:
    return lambda dump: weighted_blended.picture(dump, NEAR, FAR, equation)


# Sums of up to 26 fragments in float32: a few roundings. The weights of a mean cancel, whatever their size. The moment
# problem amplifies roundings where fragments are in two or three tight groups.
CASES: dict[str, tuple[Technique, Twin, float]] = {
    "weighted-average": (WeightedAverage(), weighted_average.picture, 5e-7),
    "weighted-blended 7": (WeightedBlended(7), blended(7), 1e-6),
    "weighted-blended 8": (WeightedBlended(8), blended(8), 1e-6),
    "weighted-blended 9": (WeightedBlended(9), blended(9), 1e-6),
    "weighted-blended 10": (WeightedBlended(), blended(10), 1e-6),
    "moment": (Moment(), moment.picture, 2e-5),
    "moment, other constants": (Moment(1e-4, 1.0), lambda dump: moment.picture(dump, 1e-4, 1.0), 2e-5),
    "stochastic": (Stochastic(), stochastic.picture, 5e-7),
    "stochastic, 1 sample": (Stochastic(1, seed=2), lambda dump: stochastic.picture(dump, 1, 2), 5e-7),
    "stochastic, 32 samples": (
        Stochastic(32, seed=2**32 - 1),
        lambda dump: stochastic.picture(dump, 32, 2**32 - 1),
        5e-7,
    ),
    "wavelet": (Wavelet(), wavelet.picture, 1e-6),
}
NAMES = ["weighted-average", "weighted-blended", "moment", "stochastic", "wavelet"]


@pytest.mark.parametrize("case", CASES)
def test_the_picture_is_its_twins(frame: Frame, dump: FragmentDump, case: str) -> None:
    made, twin, bound = CASES[case]
    error = np.abs(made.render(frame, UNUSED).linear.reshape(-1, 3) - twin(dump))
    assert error.max() <= bound
    assert np.quantile(error, 0.999) <= 1e-6


def test_weights_by_depth_have_a_floor_at_the_far_plane(gl: moderngl.Context) -> None:
    rng = np.random.default_rng(3)
    near = stacks.Stack(np.array([0.5]), np.array([128]))
    far = stacks.Stack(np.linspace(985.0, 1000.0, 8), rng.integers(1, 255, 8))
    scene = stacks.stack_scene({"near": near, "far": far})
    frame = Frame(GpuScene(gl, scene), stacks.VIEW, *stacks.size(2))
    planes = stacks.VIEW.clip_range(scene.bounds)
    truth = weighted_blended.picture(capture(frame).dump, *planes)
    assert frame.count().max() == 8
    linear = WeightedBlended().render(frame, UNUSED).linear.reshape(-1, 3)
    np.testing.assert_allclose(linear, truth, atol=1e-6, rtol=0)


@pytest.mark.parametrize("name", NAMES)
def test_pixels_of_one_fragment_and_of_none_are_exact(frame: Frame, dump: FragmentDump, name: str) -> None:
    exact = composite(dump, dump.counts.astype(np.int32))
    picture = technique(name).render(frame, UNUSED).linear.reshape(-1, 3)
    few = dump.counts <= 1
    assert (dump.counts == 1).any()
    np.testing.assert_allclose(picture[few], exact[few], atol=1e-6, rtol=0)
    assert np.abs(picture - exact).max() > 0.01, "the others are approximate: nothing here took the exact path"


@pytest.mark.parametrize("name", NAMES)
def test_a_picture_is_identical_from_run_to_run(gl: moderngl.Context, frame: Frame, name: str) -> None:
    again = Frame(GpuScene(gl, shells()), VIEW, *SIZE)
    assert np.array_equal(technique(name).render(frame, UNUSED).linear, technique(name).render(again, UNUSED).linear)


@pytest.mark.parametrize("name", NAMES)
def test_nothing_in_sight_is_the_background(gl: moderngl.Context, name: str) -> None:
    away = VIEW.model_copy(update={"target": (4.0, 3.0, 10.0)})
    empty = Frame(GpuScene(gl, shells()), away, 32, 20, clear=(0.25, 1.0, 0.0))
    rendered = technique(name).render(empty, UNUSED)
    np.testing.assert_allclose(rendered.linear, np.broadcast_to((0.25, 1.0, 0.0), (20, 32, 3)), atol=2e-3)


@pytest.mark.parametrize(
    ("name", "passes", "pixel_bytes", "pool_bytes"),
    [
        ("weighted-average", ["opaque", "sums", "resolve"], 20, 0),
        ("weighted-blended", ["opaque", "sums", "resolve"], 20, 0),
        ("moment", ["opaque", "count", "moments", "blend", "resolve"], 48, 0),
        ("stochastic", ["opaque", "samples", "blend", "resolve"], 20, 4 * 8 * SIZE[0] * SIZE[1]),
        ("wavelet", ["opaque", "count", "coefficients", "blend", "resolve"], 96, 0),
    ],
)
def test_every_pass_and_byte_is_reported(
    frame: Frame, name: str, passes: list[str], pixel_bytes: int, pool_bytes: int
) -> None:
    rendered = technique(name).render(frame, UNUSED)
    assert list(rendered.passes) == passes
    assert (rendered.pixel_bytes, rendered.pool_bytes) == (pixel_bytes, pool_bytes)
    assert rendered.captured == rendered.k.sum() == 0


def test_moment_visits_occupied_tiles_only(frame: Frame) -> None:
    assert technique("moment").render(frame, UNUSED).skips[EMPTY_TILES] > 0


def test_stochastic_in_bands_of_rows_is_the_same_picture(frame: Frame, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = Stochastic().render(frame, UNUSED)
    rows = 7
    small = replace(LIMITS, buffer_bytes=rows * 4 * 8 * frame.width + 5)
    monkeypatch.setattr("renderer.techniques.stochastic.LIMITS", small)
    banded = Stochastic().render(frame, UNUSED)
    assert np.array_equal(banded.linear, whole.linear)
    assert banded.pool_bytes == rows * 4 * 8 * frame.width


def test_another_seed_is_other_noise_about_the_exact_picture(gl: moderngl.Context) -> None:
    untied = Frame(GpuScene(gl, shells(duplicates=1)), VIEW, *SIZE)
    exact = technique("sbuffer").render(untied, UNUSED).linear
    noise = [Stochastic(seed=seed).render(untied, UNUSED).linear - exact for seed in range(8)]
    alone = np.mean([np.square(one).mean() for one in noise])
    assert np.square(np.mean(noise, axis=0)).mean() < 0.2 * alone


@pytest.mark.parametrize("samples", [0, 33])
def test_samples_have_limits(samples: int) -> None:
    with pytest.raises(Problem, match="1 up to 32"):
        Stochastic(samples)


@pytest.mark.parametrize(
    ("bias", "overestimation"), [(0.0, 0.25), (1.0, 0.25), (5e-7, -0.1), (5e-7, 1.1), (float("nan"), 0.25)]
)
def test_moment_has_limits(bias: float, overestimation: float) -> None:
    with pytest.raises(Problem, match="overestimation"):
        Moment(bias, overestimation)
