"""The labeller, measured: certificates on every scene, speed, heaps, growth with N, several g, tails and metrics.

python -m benchmarks.labeller --out benchmarks/results/labeller.json --page benchmarks/LABELLER.md
python -m benchmarks.labeller --only certified --out benchmarks/results/labeller.json --page benchmarks/LABELLER.md

Parts that are not asked for stay in both files as they were measured before. Plots lie beside the figures.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from benchmarks import provenance
from benchmarks.casting.cases import SHARED
from benchmarks.labelling.page import page, plots
from benchmarks.labelling.parts import PARTS, Setting, run, wrong
from benchmarks.outputs import add_outputs, write_figures, write_page


def main(arguments: Sequence[str] | None = None) -> int:
    """Measures what was asked for, writes figures, plots and page; 1 if a result is not as it has to be."""
    given = _parse(arguments)
    setting = Setting(given.scenes, given.views, given.rows, given.quick, given.rounds)
    found: dict[str, Any] = {}
    if given.out is not None and given.out.exists():
        found = json.loads(given.out.read_text(encoding="utf-8"))
    for part in given.only:
        print(f"{part}:", file=sys.stderr, flush=True)
        before = os.getloadavg()[0]
        found[part] = {
            **provenance.head("benchmarks.labeller", arguments),
            "quick": given.quick,
            "found": run(part, setting),
            "load_average": {"before": before, "after": os.getloadavg()[0]},
        }
    text = page(found)
    print(text)
    write_figures(given.out, found, plots(found))
    write_page(given.page, text)
    problems = [line for part in given.only for line in wrong(part, found[part]["found"])]
    for line in problems:
        print(f"wrong: {line}", file=sys.stderr)
    return 1 if problems else 0


def _parse(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", nargs="+", choices=PARTS, default=list(PARTS), metavar="PART", help=", ".join(PARTS))
    parser.add_argument("--scenes", type=Path, default=SHARED, help="Folder with MANIFEST.json, for `certified`.")
    parser.add_argument("--views", type=int, help="Most views of a stage that are certified; without it, all.")
    parser.add_argument("--rows", type=Path, help="JSON lines of what is certified: a stopped run goes on there.")
    parser.add_argument("--rounds", type=int, default=9, help="Rounds of what is measured in turns.")
    parser.add_argument("--quick", action="store_true", help="Tiny views: whether everything works, not how fast.")
    add_outputs(parser)
    return parser.parse_args(arguments)


if __name__ == "__main__":
    sys.exit(main())
