"""Features: sums and what is derived of them in float32, against float64."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np
from numpy.typing import NDArray

from evaluation.stress.bounds import counted, within
from evaluation.stress.cases import Case, curve_cases
from evaluation.stress.findings import Finding, Options, worst_of
from evaluation.stress.twins import features64, sums64
from renderer.features import FEATURES, SUMS, derive, gather
from schemas.tail import BINNED_TAILS, MOST_BINS, TAILS, TailName

EVERY: Final[TailName] = "binned-16"
"""The tail that fills every sum and feature."""
KEPT: Final = tuple(f"{kept}_{b}" for kept in ("front", "mean") for b in range(1, MOST_BINS))
"""Features that are what is kept of the depth bins."""
SPREADS: Final = [i for i, name in enumerate(FEATURES) if "_std" in name]
"""Columns of the standard deviations."""
FRONTS: Final = [FEATURES.index(name) for name in KEPT]
"""Columns of what is kept of the depth bins."""
_OTHERS: Final = [i for i in range(len(FEATURES)) if i not in SPREADS + FRONTS]


def run(options: Options) -> Iterator[Finding]:
    """Every case, each column of sums and features."""
    rows: dict[str, list[Finding]] = {}
    for case in curve_cases(options.quick, options.seed):
        if not case.dump.rgba[:, 3].min(initial=1):
            continue  # alpha 0 is never in a dump, and a list of nothing else has no optical depth
        sums, sums_truth = gather(case.dump, EVERY), sums64(case.dump, EVERY)
        features, truth = derive(sums), features64(sums_truth)
        for path, found, expected, every, names in (
            ("features.gather", sums, sums_truth, SUMS, SUMS),
            ("features.derive", features, truth, FEATURES, [FEATURES[i] for i in _OTHERS]),
            ("features.spread", features, truth, FEATURES, [FEATURES[i] for i in SPREADS]),
        ):
            columns = [every.index(name) for name in names]
            places = [f"{name}, pixel {p}" for p in range(len(found)) for name in names]
            row = within(path, case.name, found[:, columns].ravel(), expected[:, columns].ravel(), places)
            rows.setdefault(path, []).append(row)
        for tail in BINNED_TAILS:
            rows.setdefault("features.kept", []).append(_kept(case, tail))
    for path_rows in rows.values():
        yield worst_of(path_rows, f"{len(path_rows)} inputs")


def in_steps(features: NDArray[np.floating], tail: TailName) -> NDArray[np.float64]:
    """float64 [P, len(KEPT)], what is kept of depth bins in whole steps.

    Args:
        features: [P, F], columns `FEATURES`.
        tail: The tail that kept it.
    """
    row = TAILS[tail]
    levels = np.where([name.startswith("front") for name in KEPT], row.share_levels, row.mean_levels)
    return np.rint(features[:, FRONTS].astype(np.float64) * levels)


def _kept(case: Case, tail: TailName) -> Finding:
    """Shares of the optical depth in front of bins, and mean positions in them, in whole steps."""
    found = in_steps(derive(gather(case.dump, tail)), tail)
    truth = in_steps(features64(sums64(case.dump, tail)), tail)
    wrong = np.argwhere(found != truth)
    where = f"{tail}, {KEPT[wrong[0, 1]]}, pixel {wrong[0, 0]}" if len(wrong) else ""
    return counted("features.kept", case.name, len(wrong), where)
