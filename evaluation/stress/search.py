"""A short search for the worst case: hill climbing over small lists, and over the features of a network.

A search consists of climbs. Climb i of seed s is the same wherever and whenever it is made: `worst_list(s, i)` and
`worst_features(s, i)` make what a row of the table names again. Only how many climbs there are depends on the time.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Final, TypeVar

import numpy as np
from numpy.typing import NDArray

from evaluation.stress.bounds import within
from evaluation.stress.cases import dump_of, some_list
from evaluation.stress.curves import reference_errors
from evaluation.stress.findings import Finding, NotRun, Options, Row
from evaluation.stress.predictors import NEEDED, Predict, form, networks, predicted64, real_features
from evaluation.stress.threads import one_thread
from labeller.curves import error_curves
from schemas.bundle import FEATURE_LIMIT
from schemas.fragments import FragmentDump
from schemas.tail import DENSITY_G, METRICS, TAIL_NAMES, MetricName, TailName

if TYPE_CHECKING:
    from trainer.weights import Weights

STEPS: Final = 60
"""Changes that a climb tries."""
_ALPHAS: Final = np.array([0, 1, 2, 127, 128, 253, 254])
_LEVELS: Final = np.array([0, 1, 2, 14, 15, 254, 255])  # 14/255 and 15/255: where the sRGB curve's line ends
_POPULATION: Final = 64

T = TypeVar("T")


def run(options: Options) -> Iterator[Row]:
    """The worst of as many climbs as fit in the time, for curves and for each form of a network."""
    if options.search <= 0.0:
        return
    with one_thread():
        found = _search(options.search, lambda climb: list_finding(*worst_list(options.seed, climb)))
    yield found
    real = real_features(np.random.default_rng(options.seed), 500)
    weights = next(iter(networks(options.seed, real).values()))
    with tempfile.TemporaryDirectory() as folder:
        forms = {path: form(path, weights, Path(folder)) for path in NEEDED}
    for path, predict in forms.items():
        if isinstance(predict, NotRun):
            continue  # said by the suite of the networks

        def climb_once(climb: int, path: str = path, predict: Predict = predict) -> Finding:
            inputs = worst_features(options.seed, climb, weights, real, predict)
            return _features_finding(path, weights, predict, inputs)

        yield _search(options.search, climb_once)


def _search(seconds: float, climb_once: Callable[[int], Finding]) -> Finding:
    best, climbs, end = climb_once(0), 1, time.monotonic() + seconds
    while time.monotonic() < end:
        found = climb_once(climbs)
        if found.error > best.error:
            best = replace(found, where=f"climb {climbs}: {found.where}")
        climbs += 1
    return best if best.where.startswith("climb") else replace(best, where=f"climb 0: {best.where}")


def worst_list(seed: int, climb: int) -> tuple[FragmentDump, TailName, MetricName]:
    """The worst list of one climb: one pixel, and the tail and metric whose error was driven up."""
    rng = np.random.default_rng([seed, climb])
    tail = TAIL_NAMES[int(rng.integers(len(TAIL_NAMES)))]
    metric = METRICS[int(rng.integers(len(METRICS)))]
    n = int(rng.integers(1, 9))
    depth = [(1.0, 10.0), (1e-3, 1e4), (1.0, 1.000001)][int(rng.integers(3))]
    best = dump_of([some_list(rng, n, None if rng.random() < 0.5 else _ALPHAS.tolist(), depth)], _colours(rng, (1, 3)))
    most = list_finding(best, tail, metric).error
    for _ in range(STEPS):
        tried = _changed(rng, best)
        error = list_finding(tried, tail, metric).error
        if error >= most:
            best, most = tried, error
    return best, tail, metric


def list_finding(dump: FragmentDump, tail: TailName, metric: MetricName) -> Finding:
    """Error of a dump's curves with one tail and metric; the case spells the first pixel out."""
    entries = list(reference_errors(dump, tail, metric))
    curves = error_curves(dump, tail, DENSITY_G, metric)
    found = np.array([curves.error[curves.offsets[x.pixel] + x.k] for x in entries])
    truth = np.array([x.error for x in entries])
    return within("curves.search", f"{tail}, {metric}, n {dump.total}", found, truth, [f"k {x.k}" for x in entries])


def _changed(rng: np.random.Generator, dump: FragmentDump) -> FragmentDump:
    """One byte, one depth, or the background changed a little or at random."""
    rgba, depth, background = dump.rgba.copy(), dump.depth.copy(), dump.background.copy()
    at, channel = int(rng.integers(dump.total)), int(rng.integers(4))
    kind = rng.random()
    if kind < 0.6:
        old = int(rgba[at, channel])
        near = int(np.clip(old + rng.integers(-2, 3), 0, 255 if channel < 3 else 254))
        wild = int(rng.choice(_ALPHAS)) if channel == 3 else int(_colours(rng, (1,))[0])
        rgba[at, channel] = near if rng.random() < 0.5 else wild
    elif kind < 0.8:
        depth[at] = depth[int(rng.integers(dump.total))] if rng.random() < 0.3 else depth[at] * rng.uniform(0.5, 2.0)
    else:
        background[0, channel % 3] = _colours(rng, (1,))[0]
    return dump_of([(rgba, depth)], background)


def _colours(rng: np.random.Generator, shape: tuple[int, ...]) -> NDArray[np.integer]:
    return np.where(rng.random(shape) < 0.5, rng.choice(_LEVELS, shape), rng.integers(0, 256, shape))


def worst_features(
    seed: int, climb: int, weights: Weights, real: NDArray[np.float32], predict: Predict
) -> NDArray[np.float32]:
    """float32 [128, F], the batch of one climb in which a row was worst, within the clamp of a network's inputs.

    A whole batch, because what a library answers to a row can depend on those beside it.

    Args:
        seed: Of the search.
        climb: Which.
        weights: The network.
        real: float32 [R, F], features of pixels to start from.
        predict: The form that is compared with float64.
    """
    rng = np.random.default_rng([seed, climb])
    low, high = weights.mean - FEATURE_LIMIT * weights.std, weights.mean + FEATURE_LIMIT * weights.std
    rows = real[rng.integers(0, len(real), _POPULATION)]
    best, most = rows, -1.0
    for _ in range(STEPS // 4):
        wild = rng.uniform(low, high, rows.shape).astype(np.float32)
        children = np.where(rng.random(rows.shape) < rng.choice([0.05, 0.3]), wild, rows)
        every = np.concatenate([rows, children])
        errors = _errors(weights, predict, every)
        if errors.max() > most:
            best, most = every, float(errors.max())
        order = np.argsort(-errors, kind="stable")
        rows = np.concatenate([every[order[: _POPULATION // 4]]] * 4)  # the best have four children each
    return best


def _errors(weights: Weights, predict: Predict, rows: NDArray[np.float32]) -> NDArray[np.float64]:
    truth = predicted64(weights, rows)
    relative = np.abs(predict(rows) - truth) / np.maximum(np.abs(truth), 1.0)
    return np.asarray(relative.max(axis=1))


def _features_finding(path: str, weights: Weights, predict: Predict, inputs: NDArray[np.float32]) -> Finding:
    places = [f"row {row}" for row in range(len(inputs))]
    return within("predict.search", path, predict(inputs), predicted64(weights, inputs), places)
