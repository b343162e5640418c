"""Features: sums and what is derived of them in float32, against float64."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from renderer.features import FEATURES, SUMS, derive, gather
from services.stress.bounds import within
from services.stress.cases import curve_cases
from services.stress.findings import Finding, Options, worst_of
from services.stress.twins import features64, sums64

SPREADS: Final = [i for i, name in enumerate(FEATURES) if "_std" in name]
"""Columns of the standard deviations."""
_OTHERS: Final = [i for i in range(len(FEATURES)) if i not in SPREADS]


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
    for path_rows in rows.values():
        yield worst_of(path_rows, f"{len(path_rows)} inputs")
