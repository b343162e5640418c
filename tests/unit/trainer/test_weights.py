"""Networks as plain arrays: heads, outputs, files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch
from support.training import random_weights, real_features

from renderer.features import FEATURES
from schemas.bundle import ACTIVATIONS, HEADS, HeadName, gain_outputs
from schemas.tail import MOST_BINS
from trainer.models import Network
from trainer.weights import activate, load_weights, save_weights

EVERY: list[HeadName] = list(HEADS)


def test_activations_are_the_documented_functions_and_do_not_overflow() -> None:
    raw = np.array([-1e4, -30.0, -1.0, 0.0, 1.0, 30.0, 1e4], np.float32)
    with np.errstate(over="ignore"):
        sigmoid = 1.0 / (1.0 + np.exp(-raw.astype(np.float64)))
        softplus = np.where(raw > 500.0, raw, np.log1p(np.exp(np.minimum(raw, 500.0).astype(np.float64))))
    expected = {**dict.fromkeys(gain_outputs(MOST_BINS), raw), "prior": softplus, "importance": sigmoid}
    assert set(expected) == set(ACTIVATIONS)
    for name, values in expected.items():
        np.testing.assert_allclose(activate((name,), raw[:, None])[:, 0], values, rtol=1e-6, atol=1e-12)


@pytest.mark.parametrize("head", EVERY)
def test_torch_and_numpy_agree_for_every_head(head: HeadName) -> None:
    weights, features = random_weights(5, FEATURES[:6], (7, 3), head), real_features(500, 2)
    with torch.no_grad():
        answers = Network.from_weights(weights)(torch.from_numpy(features[:, weights.columns].copy())).numpy()
    np.testing.assert_allclose(weights.run(features), answers, rtol=1e-5, atol=1e-5)
    assert answers.shape == (500, len(weights.outputs))


@pytest.mark.parametrize("head", EVERY)
def test_a_file_gives_back_the_network(tmp_path: Path, head: HeadName) -> None:
    weights = random_weights(1, FEATURES[:4], (3,), head)
    save_weights(tmp_path / "w", weights)
    read = load_weights(tmp_path / "w")
    assert (read.head, read.outputs, read.digest()) == (head, weights.outputs, weights.digest())
