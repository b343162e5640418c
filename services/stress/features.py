"""Features: sums and what is derived of them in float32, against float64."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np

from renderer.features import FEATURES, SUMS, derive, gather
from schemas.tail import DENSITY_BINS, SHARE_LEVELS
from services.stress.bounds import counted, within
from services.stress.cases import Case, curve_cases
from services.stress.findings import Finding, Options, worst_of
from services.stress.twins import features64, sums64

SPREADS: Final = [i for i, name in enumerate(FEATURES) if "_std" in name]
"""Columns of the standard deviations."""
FRONTS: Final = [i for i, name in enumerate(FEATURES) if name.startswith("front_")]
"""Columns of what is kept of the depth bins."""
_OTHERS: Final = [i for i in range(len(FEATURES)) if i not in SPREADS + FRONTS]


def run(options: Options) -> Iterator[Finding]:
    """Every case, each column of sums and features."""
    rows: dict[str, list[Finding]] = {}
    for case in curve_cases(options.quick, options.seed):
        if not case.dump.rgba[:, 3].min(initial=1):
            continue  # alpha 0 is never in a dump, and a list of nothing else has no mean colour
        sums, sums_truth = gather(case.dump), sums64(case.dump)
        features, truth = derive(sums), features64(sums_truth)
        for path, found, expected, names in (
            ("features.gather", sums, sums_truth, SUMS),
            ("features.derive", features[:, _OTHERS], truth[:, _OTHERS], [FEATURES[i] for i in _OTHERS]),
            ("features.spread", features[:, SPREADS], truth[:, SPREADS], [FEATURES[i] for i in SPREADS]),
        ):
            places = [f"{name}, pixel {p}" for p in range(len(found)) for name in names]
            rows.setdefault(path, []).append(within(path, case.name, found.ravel(), expected.ravel(), places))
        for bins in DENSITY_BINS.values():
            rows.setdefault("features.front", []).append(_fronts(case, bins))
    for path_rows in rows.values():
        yield worst_of(path_rows, f"{len(path_rows)} inputs")


def _fronts(case: Case, bins: int) -> Finding:
    """Shares of the optical depth in front of bins, in whole steps."""
    found = derive(gather(case.dump, bins))[:, FRONTS] * np.float64(SHARE_LEVELS)
    truth = features64(sums64(case.dump, bins))[:, FRONTS] * SHARE_LEVELS
    wrong = np.argwhere(np.rint(found) != np.rint(truth))
    where = f"{bins} bins, {FEATURES[FRONTS[wrong[0, 1]]]}, pixel {wrong[0, 0]}" if len(wrong) else ""
    return counted("features.front", case.name, len(wrong), where)
