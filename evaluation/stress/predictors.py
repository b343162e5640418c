"""A network in numpy, torch and onnxruntime against float64, on features made to break it; and features as float16.

The GLSL form is with the other shaders, in `evaluation.stress.gl`.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from evaluation.stress.bounds import counted, within
from evaluation.stress.cases import random_dump
from evaluation.stress.features import EVERY
from evaluation.stress.findings import Finding, NotRun, Options, Row, worst_of
from evaluation.stress.twins import network64
from renderer.allocation.prices import gain_prices, ranks_of
from renderer.features import FEATURES, derive, gather
from schemas.bundle import FEATURE_LIMIT, ONNX, gain_outputs
from schemas.tail import TAILS

if TYPE_CHECKING:
    from trainer.weights import Weights

Rows = NDArray[np.float32]
Predict = Callable[[Rows], Rows]

OUTPUTS: Final = gain_outputs(TAILS[EVERY].bins)
"""Of the networks here; a tail of fewer bins reads fewer."""

NEEDED: Final = {"predict.numpy": (), "predict.torch": ("torch", "moderngl"), "predict.onnx": ("onnx", "onnxruntime")}
"""Form of the network -> libraries without which it is not run here."""


def run(options: Options) -> Iterator[Row]:
    """All forms that are installed, on the same inputs; then ranks, and float16."""
    rng = np.random.default_rng(options.seed)
    real = real_features(rng, 500 if options.quick else 20_000)
    for number, (name, weights) in enumerate(networks(options.seed, real).items()):
        with tempfile.TemporaryDirectory() as folder:
            forms = {path: form(path, weights, Path(folder)) for path in NEEDED}
        for path, predict in forms.items():
            if isinstance(predict, NotRun):
                if number == 0:
                    yield predict
                continue
            cases = feature_cases(rng, weights, real)
            found = [_compared(path, case, predict, weights, inputs) for case, inputs in cases.items()]
            yield worst_of(found, f"{name}, {len(found)} kinds of inputs")
            yield _ranks(path, name, predict, weights, real, rng)
        yield from _float16(name, weights, real, rng)


def form(path: str, weights: Weights, folder: Path) -> Predict | NotRun:
    """One form of the network: float32 [R, F] to float32 [R, outputs]; or why there is none here.

    Args:
        path: A key of `NEEDED`.
        weights: The network.
        folder: For the files that it needs while it is made.
    """
    missing = [name for name in NEEDED[path] if find_spec(name) is None]
    if missing:
        return NotRun(path, f"{' and '.join(missing)} not installed")
    if path == "predict.numpy":
        return lambda inputs: _in_numpy(weights, inputs)
    if path == "predict.torch":
        from trainer.parity import torch_outputs

        return lambda inputs: torch_outputs(weights, inputs[:, weights.columns])
    from renderer.onnx_network import OnnxNetwork
    from trainer.export_onnx import onnx_model

    (folder / ONNX).write_bytes(onnx_model(weights))
    network = OnnxNetwork(folder / ONNX)
    return lambda inputs: network.run(inputs[:, weights.columns])


def _in_numpy(weights: Weights, inputs: Rows) -> Rows:
    with np.errstate(over="ignore"):  # what overflows when it is divided by the spread is clamped
        return weights.run(inputs)


def predicted64(weights: Weights, inputs: Rows) -> NDArray[np.float64]:
    """float64 [R, outputs], what the network answers to float32 [R, F]."""
    return network64(weights.mean, weights.std, weights.layers, inputs[:, weights.columns])


def real_features(rng: np.random.Generator, rows: int) -> Rows:
    """float32 [rows, F] of pixels with fragments, depth bins included."""
    features = derive(gather(random_dump(rng, math.ceil(1.3 * rows) + 8, 9), EVERY))
    return features[features.any(axis=1)][:rows]


def networks(seed: int, real: Rows, small: bool = False) -> dict[str, Weights]:
    """Networks with outputs of the size that trained ones have, normalised as training does.

    Args:
        seed: Of the weights.
        real: float32 [R, F], features whose mean and spread normalise the inputs.
        small: With few units: a software driver compiles a network of the default size for many seconds.
    """
    from trainer.weights import Weights

    made = {}
    for hidden, least in (((8, 6), 1e-2), ((12, 12, 12), 1e-4)) if small else (((32, 16), 1e-2), ((64, 64, 64), 1e-4)):
        name = "-".join(map(str, hidden)) + ("" if least == 1e-2 else ", features of spread 1e-4")
        rng = np.random.default_rng(seed)
        layers = random_layers(rng, hidden, len(OUTPUTS))
        std = real.std(axis=0) if least == 1e-2 else np.full(len(FEATURES), least)
        std = np.maximum(std, least).astype(np.float32)
        made[name] = Weights(FEATURES, real.mean(axis=0).astype(np.float32), std, layers, "bin-gains", OUTPUTS)
    return made


def random_layers(rng: np.random.Generator, hidden: tuple[int, ...], outputs: int) -> tuple[tuple[Rows, Rows], ...]:
    """Weights and biases of the size that training gives, float32.

    Args:
        rng: Draws them.
        hidden: Units of the hidden layers.
        outputs: Numbers of an answer: gains of bins, and how much the prior counts.
    """
    sizes = (len(FEATURES), *hidden, outputs)
    layers = [
        (
            rng.normal(0.0, 1.5 / math.sqrt(fan_in), (fan_out, fan_in)).astype(np.float32),
            rng.normal(0.0, 0.3, fan_out).astype(np.float32),
        )
        for fan_in, fan_out in pairwise(sizes)
    ]
    layers[-1][1][:-1] -= 4.0
    return tuple(layers)


def feature_cases(rng: np.random.Generator, weights: Weights, real: Rows) -> dict[str, Rows]:
    """Inputs of a network, float32 [R, F]: real ones, and such as no picture has."""
    rows, columns = min(len(real), 2000), len(FEATURES)
    mean, std = weights.mean, weights.std
    signs = rng.choice([-1.0, 1.0], (rows, columns))
    cases = {
        "features of pixels": real,
        "all 0": np.zeros((1, columns)),
        "at the clamp": mean + FEATURE_LIMIT * std * signs * (1.0 + rng.integers(-2, 3, (rows, columns)) * 2.0**-23),
        "1 ulp around the mean": mean + signs * np.spacing(mean),
        "denormal": signs * 1e-44,
        "huge": signs * 3e38,
        "infinite": signs * np.inf,
        "each at one limit": np.repeat(mean[None], 2 * columns, axis=0)
        + FEATURE_LIMIT * std * np.concatenate([np.eye(columns), -np.eye(columns)]),
    }
    return {name: np.asarray(values, np.float32) for name, values in cases.items()}


def _compared(path: str, case: str, predict: Predict, weights: Weights, inputs: Rows) -> Finding:
    places = [f"row {row}" for row in range(len(inputs))]
    return within(path, case, predict(inputs), predicted64(weights, inputs), places)


def _ranks(path: str, name: str, predict: Predict, weights: Weights, real: Rows, rng: np.random.Generator) -> Finding:
    """Ranks of float32 predictions against those of float64 ones."""
    difference, changed = _rank_difference(predict(real), predicted64(weights, real), rng)
    return counted("predict.ranks", f"{path}, {name}", difference, f"{changed} of {len(real)} pixels change")


def _rank_difference(
    found: NDArray[np.floating], truth: NDArray[np.float64], rng: np.random.Generator
) -> tuple[int, int]:
    """Largest difference of a bin's rank between two predictions, and how many pixels have one."""
    counts = rng.integers(0, 4, (len(truth), truth.shape[1] - 1))
    prior = rng.uniform(-12.0, 0.0, counts.shape).astype(np.float32)
    ranks = (ranks_of(gain_prices(answers.astype(np.float32), prior), counts) for answers in (found, truth))
    apart = np.abs(np.subtract(*(rank.astype(np.int64) for rank in ranks)))
    return int(apart.max()), int(apart.any(axis=1).sum())


def _float16(name: str, weights: Weights, real: Rows, rng: np.random.Generator) -> Iterator[Finding]:
    """What a network answers to features that were stored as float16, and the ranks that follow."""
    rounded = real.astype(np.float16).astype(np.float32)
    truth, found = predicted64(weights, real), predicted64(weights, rounded)
    places = [f"row {row}" for row in range(len(real))]
    yield within("features.float16", f"{name}: answers", found, truth, places)
    difference, changed = _rank_difference(found, truth, rng)
    share = f"{changed} of {len(real)} pixels change"
    yield counted("features.float16", f"{name}: rank of a bin", difference, share)
