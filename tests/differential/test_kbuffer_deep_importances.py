"""`kbuffer-deep` with importances: they become prices in the frame, and cuts as in the twin."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from support.training import export_random, random_weights

from renderer.allocation.cuts import events_of, solve_cuts
from renderer.allocation.gpu import FrameAllocation
from renderer.allocation.prices import importance_prices, ranks_of
from renderer.bin_pass import Binned
from renderer.features import TEXELS, derive, gather
from renderer.frame import Frame
from renderer.techniques import Budget, KBufferDeep
from schemas.fragments import FragmentDump
from schemas.tail import DEFAULT_TAIL

_GIVEN = 4
"""A storage binding that `prices.comp` does not use."""
NETWORK = f"""
#define DIAPHANE_FEATURES 1
layout(std430, binding = {_GIVEN}) readonly buffer Given {{ float given[]; }};
void diaphane_features(in vec4 s[{TEXELS}], out float x[DIAPHANE_FEATURES]) {{ x[0] = 0.0; }}
struct DiaphaneAnswer {{ float y[1]; }};
DiaphaneAnswer diaphane_predict(in float x[DIAPHANE_FEATURES]) {{
    uint group = gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
    return DiaphaneAnswer(float[1](given[64u * group + gl_LocalInvocationIndex]));
}}
"""
"""Answers what a buffer holds for the pixel."""


class Given(KBufferDeep):
    """With importances that a test gives, float32 [P], in place of a network's."""

    def __init__(self, bundle: Path, importance: NDArray[np.float32]) -> None:
        super().__init__(bundle)
        self._texts = {"bundle/predict.glsl": NETWORK}
        self._importance = importance

    def _predict_ranks(self, frame: Frame, binned: Binned, allocation: FrameAllocation) -> None:
        given = frame.ctx.buffer(self._importance)  # bound for as long as it is held
        given.bind_to_storage_buffer(_GIVEN)
        super()._predict_ranks(frame, binned, allocation)


@pytest.fixture(scope="module")
def bundle(dump: FragmentDump, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("bundle")
    network = random_weights(5, ("log_n", "front_2"), (8,), "importance")
    export_random(folder, network, derive(gather(dump, DEFAULT_TAIL))[dump.counts > 0])
    return folder


def cases(rng: np.random.Generator, pixels: int) -> dict[str, NDArray[np.float32]]:
    values = {
        "random": rng.random(pixels),
        "labels of DHOIT": 1.0 / (1.0 + np.exp(rng.normal(13.0, 2.0, pixels))),
        "1e-13 to 1": 10.0 ** rng.uniform(-13.0, 0.0, pixels),
        "0 or random": rng.random(pixels) * rng.integers(0, 2, pixels),
        "NaN or random": np.where(rng.integers(0, 2, pixels) == 0, np.nan, rng.random(pixels)),
        "all 0": np.zeros(pixels),
        "all NaN": np.full(pixels, np.nan),
        "all equal": np.full(pixels, 1 / 3),
        "0, NaN or equal": rng.choice([0.0, np.nan, 0.3], pixels),
        "1 and 1e-7": np.where(rng.integers(0, 2, pixels) == 0, 1.0, 1e-7),
        "one": np.arange(pixels) == pixels // 2,
    }
    return {name: np.asarray(each, np.float32) for name, each in values.items()}


@pytest.mark.parametrize("name", list(cases(np.random.default_rng(0), 1)))
def test_cuts_are_those_of_the_twin(bundle: Path, frame: Frame, dump: FragmentDump, name: str) -> None:
    """From no fragment to more than there are; a logarithm that the driver rounds otherwise moves few of them."""
    importance = cases(np.random.default_rng(3), dump.pixels)[name]
    by_bin = frame.kept_bins(DEFAULT_TAIL).counts()
    deep, ranks = Given(bundle, importance), ranks_of(importance_prices(importance, by_bin), by_bin)
    for fragments in (0, 1, dump.total // 10, dump.total // 3, dump.total - 1, dump.total, 2 * dump.total):
        k = deep.render(frame, Budget(fragments)).k
        expected = solve_cuts(events_of(ranks, by_bin), fragments).k
        assert k.sum() <= fragments
        assert ((k >= 0) & (k <= dump.counts)).all()
        assert np.count_nonzero(k != expected) <= 1e-3 * np.count_nonzero(dump.counts)


def test_an_importance_that_is_nan_is_none(bundle: Path, frame: Frame, dump: FragmentDump) -> None:
    odd = np.arange(dump.pixels) % 2 == 1
    budget = int(dump.counts[~odd].sum()) // 2
    rendered = Given(bundle, np.where(odd, np.nan, 0.5).astype(np.float32)).render(frame, Budget(budget))
    assert budget - int(dump.counts.max()) < rendered.captured <= budget
    assert (rendered.k[odd] == 0).all()
