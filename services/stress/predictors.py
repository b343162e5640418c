"""A network in numpy, torch and onnxruntime against float64, on features made to break it; and features as float16.

The GLSL form is with the other shaders, in `services.stress.gl`.
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

from renderer.allocation.fill import solve_lambda
from renderer.features import FEATURES, derive, gather
from schemas.bundle import FEATURE_LIMIT, ONNX
from services.stress.bounds import counted, within
from services.stress.cases import random_dump
from services.stress.features import EVERY
from services.stress.findings import Finding, NotRun, Options, Row, worst_of
from services.stress.twins import network64

if TYPE_CHECKING:
    from trainer.weights import Weights

Rows = NDArray[np.float32]
Predict = Callable[[Rows], Rows]

NEEDED: Final = {"predict.numpy": (), "predict.torch": ("torch", "moderngl"), "predict.onnx": ("onnx", "onnxruntime")}
"""Form of the network -> libraries without which it is not run here."""


def run(options: Options) -> Iterator[Row]:
    """All forms that are installed, on the same inputs; then counts, and float16."""
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
            yield _counts(path, name, predict, weights, real, rng)
        yield from _float16(name, weights, real, rng)


def form(path: str, weights: Weights, folder: Path) -> Predict | NotRun:
    """One form of the network: float32 [R, F] to float32 [R, 2]; or why there is none here.

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
        return np.stack(weights.predict(inputs), axis=1)


def predicted64(weights: Weights, inputs: Rows) -> NDArray[np.float64]:
    """float64 [R, 2], what the network answers to float32 [R, F]."""
    return network64(weights.mean, weights.std, weights.layers, inputs[:, weights.columns])


def real_features(rng: np.random.Generator, rows: int) -> Rows:
    """float32 [rows, F] of pixels with fragments, depth bins included."""
    features = derive(gather(random_dump(rng, math.ceil(1.3 * rows) + 8, 9), EVERY))
    return features[features.any(axis=1)][:rows]


def networks(seed: int, real: Rows) -> dict[str, Weights]:
    """Networks with outputs of the size that trained ones have, normalised as training does.

    Args:
        seed: Of the weights.
        real: float32 [R, F], features whose mean and spread normalise the inputs.
    """
    from trainer.weights import Weights

    made = {}
    for name, hidden, least in (("32-16", (32, 16), 1e-2), ("64-64-64, features of spread 1e-4", (64, 64, 64), 1e-4)):
        rng = np.random.default_rng(seed)
        layers = random_layers(rng, hidden)
        std = real.std(axis=0) if least == 1e-2 else np.full(len(FEATURES), least)
        std = np.maximum(std, least).astype(np.float32)
        made[name] = Weights(FEATURES, real.mean(axis=0).astype(np.float32), std, layers)
    return made


def random_layers(rng: np.random.Generator, hidden: tuple[int, ...]) -> tuple[tuple[Rows, Rows], ...]:
    """Weights and biases of the size that training gives, float32.

    Args:
        rng: Draws them.
        hidden: Units of the hidden layers.
    """
    sizes = (len(FEATURES), *hidden, 2)
    layers = [
        (
            rng.normal(0.0, 1.5 / math.sqrt(fan_in), (fan_out, fan_in)).astype(np.float32),
            rng.normal(0.0, 0.3, fan_out).astype(np.float32),
        )
        for fan_in, fan_out in pairwise(sizes)
    ]
    layers[-1][1][0] = -8.0
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


def _counts(path: str, name: str, predict: Predict, weights: Weights, real: Rows, rng: np.random.Generator) -> Finding:
    """Counts of float32 predictions against those of float64 ones, at one budget."""
    difference, changed = _count_difference(predict(real).astype(np.float64), predicted64(weights, real), rng)
    return counted("predict.counts", f"{path}, {name}", difference, f"{changed} of {len(real)} pixels change")


def _count_difference(
    found: NDArray[np.float64], truth: NDArray[np.float64], rng: np.random.Generator
) -> tuple[int, int]:
    """Largest difference of a pixel's count between two predictions at the same budget, and how many differ."""
    n = rng.integers(1, 40, len(truth))
    budget = int(0.4 * n.sum())
    k, _ = solve_lambda(found[:, 0], found[:, 1], n, budget)
    expected, _ = solve_lambda(truth[:, 0], truth[:, 1], n, budget)
    return int(np.abs(k - expected).max()), int((k != expected).sum())


def _float16(name: str, weights: Weights, real: Rows, rng: np.random.Generator) -> Iterator[Finding]:
    """What a network answers to features that were stored as float16, and the counts that follow."""
    rounded = real.astype(np.float16).astype(np.float32)
    truth, found = predicted64(weights, real), predicted64(weights, rounded)
    places = [f"row {row}" for row in range(len(real))]
    yield within("features.float16", f"{name}: a and b", found, truth, places)
    difference, changed = _count_difference(found, truth, rng)
    share = f"{changed} of {len(real)} pixels change"
    yield counted("features.float16", f"{name}: fragments of a pixel", difference, share)
