"""NaN and infinity: every entry point that takes arrays of numbers must refuse them, and say what is wrong."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

import labeller
from evaluation.stress.bounds import counted
from evaluation.stress.cases import dump_of, some_list
from evaluation.stress.features import EVERY
from evaluation.stress.findings import Finding, Options, Row, worst_of
from evaluation.stress.predictors import networks, real_features
from labeller.curves import composite, error_curves
from renderer.allocation.fill import budget_fill, paper_fill
from renderer.features import gather
from schemas.problem import Problem

PATH: Final = "refused.arrays"
_WORDS: Final = ("finite", "positive", "NaN", "numbers")


def run(options: Options) -> Iterator[Row]:
    """Each bad number to each entry point."""
    rng = np.random.default_rng(options.seed)
    dump = dump_of([some_list(rng, n) for n in (1, 5, 0, 3, 4)])
    n, some = dump.counts, np.ones(dump.pixels, np.float32)
    rows: dict[str, list[Finding]] = {}
    for name, number in (("NaN", np.nan), ("infinity", np.inf), ("-infinity", -np.inf)):
        depth = dump.depth.copy()
        depth[0] = number  # of a list of its own, so that the order within it is not what is wrong
        bad, wrong = replace(dump, depth=depth), some.copy()
        wrong[3] = number
        arrays: dict[str, ArrayLike] = {"offsets": dump.offsets, "rgba": dump.rgba, "depth": depth}
        calls: dict[str, Callable[[], object]] = {
            "depth, error_curves": partial(error_curves, bad),
            "depth, composite": partial(composite, bad, n),
            "depth, gather": partial(gather, bad, EVERY),
            "depth, labeller.allocate": partial(labeller.allocate, arrays, [10]),
            "g, error_curves": partial(error_curves, dump, g=number),
            "g, composite": partial(composite, dump, n, g=number),
            "weight, error_curves": partial(error_curves, dump, weights=wrong),
            "weight, budget_fill": partial(budget_fill, wrong, n, 12),
            "weight, paper_fill": partial(paper_fill, wrong, 12),
        }
        for case, call in calls.items():
            rows.setdefault(case, []).append(_refusal(name, call))
    for case, tried in rows.items():
        yield worst_of(tried, f"NaN, infinity, -infinity as {case}")
    yield from _networks(options)


def _networks(options: Options) -> Iterator[Row]:
    """A network with a weight that is NaN is not exported. What one answers to NaN is ranked last, and not refused."""
    from trainer.export_shader import shader_source

    weights = next(iter(networks(options.seed, real_features(np.random.default_rng(options.seed), 64)).values()))
    weights.layers[0][0][0, 0] = np.nan
    yield _refusal("NaN as weight of a network, GLSL", partial(shader_source, weights))


def _refusal(case: str, call: Callable[[], object]) -> Finding:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            call()
    except (Problem, ValueError) as error:
        said = str(error)
        clear = any(word in said for word in _WORDS)
        return counted(PATH, case, int(not clear), "" if clear else f"unclear: {said}")
    except Exception as error:
        return counted(PATH, case, 1, f"{type(error).__name__}: {error}")
    return counted(PATH, case, 1, "accepted")
