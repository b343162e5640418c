"""The GL suite in a process that has one GL driver: `python -m evaluation.stress.gl_child DRIVER [--quick] [--seed N]`.

Every line of its output is a JSON object: `at` says what it is doing, `row` is a row of the table, and `digest` the
hash of a case's fragments, which the parent compares between drivers.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

import moderngl
import numpy as np

from evaluation.stress import gl_allocation, gl_bins, gl_capture, gl_moment, gl_network, gl_techniques
from evaluation.stress.findings import Broken, Finding, NotRun, Options, Row
from evaluation.stress.gl_cases import Scenery, make_case, sceneries
from evaluation.stress.gl_drivers import DRIVERS, Driver
from evaluation.stress.predictors import networks, real_features
from renderer.context import describe, gl_context
from renderer.programs import Programs
from schemas.problem import Problem

KINDS: dict[str, type[Row]] = {kind.__name__: kind for kind in (Finding, NotRun, Broken)}
"""Rows by the name that a line gives."""

Say = Callable[[dict[str, Any]], None]


class Suite:
    """The whole suite in this process's context.

    Args:
        ctx: The context.
        options: As for every suite.
        driver: For the paths.
        say: Gets what is no row: `at` and `digest`.
    """

    def __init__(self, ctx: moderngl.Context, options: Options, driver: str, say: Say) -> None:
        self._ctx, self._options, self._driver, self._say = ctx, options, driver, say
        self._programs = Programs(ctx)
        self._real = real_features(np.random.default_rng(options.seed), 500)
        self._networks = networks(options.seed, self._real, small=options.quick)

    def rows(self) -> Iterator[Row]:
        """Rows of all cases together, then those of what needs no picture."""
        found: dict[bool, list[Row]] = {False: [], True: []}
        with tempfile.TemporaryDirectory() as folder:
            weights = next(iter(self._networks.values()))
            networks = gl_network.random_networks(Path(folder), weights, describe(self._ctx))
            for scenery in sceneries(self._options):
                found[scenery.deep] += self._scenery(scenery, networks)
        yield from worst_rows(found[False])
        yield from worst_rows(found[True])
        adverse = partial(gl_network.feature_rows, self._ctx, self._options, self._networks, self._real, self._driver)
        yield from worst_rows(self._step("predict.glsl", "adverse features", adverse))
        lists = partial(gl_moment.rows, self._ctx, self._options, self._driver)
        yield from worst_rows(self._step("moment.arithmetic", "lists", lists))
        ranks = partial(gl_allocation.rows, self._ctx, self._options, self._driver)
        yield from worst_rows(self._step("allocation", "ranks", ranks))

    def _scenery(self, scenery: Scenery, networks: gl_network.Networks) -> Iterator[Row]:
        self._say({"at": f"upload, {scenery.name}"})
        try:
            case = make_case(self._ctx, scenery, self._programs)
        except Exception as reason:  # as in `_step`
            yield _broken(f"{scenery.name} · {self._driver}", reason)
            return
        self._say({"digest": gl_capture.digest(case.dump), "case": scenery.name})
        yield from self._step("capture", scenery.name, partial(gl_capture.rows, case, self._driver))
        yield from self._step("bins", scenery.name, partial(gl_bins.rows, case, self._driver))
        network = partial(gl_network.rows, case, networks, self._driver)
        yield from self._step("network", scenery.name, network)
        for name, work in gl_techniques.steps(case, self._options, self._driver, networks):
            yield from self._step(name, scenery.name, work)

    def _step(self, name: str, case: str, work: Callable[[], Iterator[Finding]]) -> Iterator[Row]:
        """Rows until an exception, which is one itself."""
        self._say({"at": f"{name}, {case}"})
        try:
            yield from work()
        except Exception as reason:  # whatever a driver or a technique raises: the others still run
            yield _broken(f"{name} · {self._driver}", reason)


def worst_rows(found: Iterable[Row]) -> Iterator[Row]:
    """One row for all findings of the same path and case: the worst of each error, and where the judged one is."""
    groups: dict[tuple[str, str], list[Finding]] = {}
    for row in found:
        if isinstance(row, Finding):
            groups.setdefault((row.path, row.case), []).append(row)
        else:
            yield row
    for same in groups.values():
        worst = max(same, key=lambda row: math.inf if math.isnan(row.error) else row.error)
        absolute, relative = (float(np.max([getattr(row, name) for row in same])) for name in ("absolute", "relative"))
        where = worst.where if absolute else "nowhere"
        yield Finding(worst.path, worst.case, absolute, relative, where, worst.bound, worst.measure)


def _broken(path: str, reason: Exception) -> Broken:
    return Broken(path, " ".join(f"{type(reason).__name__}: {reason}".split()))


def _context(driver: Driver) -> moderngl.Context | NotRun:
    path = f"gl · {driver.name}"
    try:
        ctx = gl_context()
    except Problem as problem:
        return NotRun(path, f"{problem.title} It needs {driver.packages}.")
    description = describe(ctx)
    if not driver.is_it(description):
        return NotRun(path, f"OpenGL is {description} here. It needs {driver.packages}.")
    return ctx


def main(argv: Sequence[str]) -> int:
    """Run the suite; the exit status is 0 whatever it found."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("driver", choices=DRIVERS)
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args(argv)

    def say(line: dict[str, Any]) -> None:
        print(json.dumps(line), flush=True)

    ctx = _context(DRIVERS[given.driver])
    options = Options(quick=given.quick, seed=given.seed)
    made: Iterable[Row] = [ctx] if isinstance(ctx, NotRun) else Suite(ctx, options, given.driver, say).rows()
    for row in made:
        say({"row": type(row).__name__, **asdict(row)})
    say({"at": ""})
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
