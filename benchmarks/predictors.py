"""Predictors on assets they have not seen: every tail of depth bins with every size of network, and what each costs.

python -m benchmarks.predictors --scenes ../shared/scenes --scenes ../shared/training-scenes --work FOLDER \
    --out benchmarks/results/predictors.json --page benchmarks/PREDICTORS.md

No page is committed: this command makes it. It can be stopped at any time and goes on where it was: dumps, labels,
networks and scores lie in `--work`, and are made again only where the data or the code that decides them have changed.
Plots lie beside the figures. Without `--scenes` it takes the project's own scenes alone. All variants take a day or
more at full size: `--size 358x240 --views 1 --folds 3` and another `--out` tries them on an eighth of the pixels.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from benchmarks import provenance
from benchmarks.outputs import add_outputs, write_figures, write_page
from benchmarks.predicting.page import page, plots
from benchmarks.predicting.store import Store
from benchmarks.predicting.summary import rules_summary, score, variant_summary
from benchmarks.predicting.training import Trainings
from benchmarks.predicting.variants import variants
from benchmarks.predicting.views import views_of

PARTS = ("variants", "rules")
SIZE = "715x480"


def main(arguments: Sequence[str] | None = None) -> int:
    """Measures what was asked for and is missing; figures and page are written after every row."""
    given = _parse(arguments)
    if given.page_only:
        _write(given.out, given.page, json.loads(given.out.read_text(encoding="utf-8")))
        return 0
    store = Store(given.work)
    rows = views_of(store, given.scenes, given.size, given.views)
    if not rows:
        print("No view has fragments enough for a budget.", file=sys.stderr)
        return 1
    trainings = Trainings(store, rows, given.folds)
    setting = {
        "scenes": [x.name if x.is_absolute() else str(x) for x in given.scenes],
        "size": list(given.size),
        "most": given.views,
        "views": len(rows),
        "scored": sum(row.is_scored for row in rows),
        "assets": len(trainings.fold),
        "folds": len(trainings.folds),
    }
    found = _before(given.out, setting, arguments)
    if "rules" in given.parts:
        found["rules"] = rules_summary(store, rows)
        _write(given.out, given.page, found)
    for name in (given.variants or variants()) if "variants" in given.parts else ():
        start = time.perf_counter()
        summary = found["variants"][name] = variant_summary(trainings, variants()[name])
        taken = time.perf_counter() - start
        print(f"{name}: score {score(summary['q']):.3f}, {taken:.0f} s", file=sys.stderr, flush=True)
        _write(given.out, given.page, found)
    print(page(found, _name(given.out)))
    return 0


def _before(out: Path | None, setting: dict[str, Any], arguments: Sequence[str] | None) -> dict[str, Any]:
    """What is in the file from earlier runs on the same views, brought up to date."""
    found: dict[str, Any] = {"variants": {}}
    if out is not None and out.exists():
        kept = json.loads(out.read_text(encoding="utf-8"))
        found = kept if kept["setting"] == setting else found
    return {**found, "setting": setting, **provenance.head("benchmarks.predictors", arguments)}


def _write(out: Path | None, where: Path | None, found: dict[str, Any]) -> None:
    order = list(variants())
    known = {name: row for name, row in found["variants"].items() if name in order}
    found["variants"] = dict(sorted(known.items(), key=lambda item: order.index(item[0])))
    write_figures(out, found, plots(found, _name(out)))
    write_page(where, page(found, _name(out)))


def _name(out: Path | None) -> str:
    """Of the figures' file; the usual one where none is written."""
    return "predictors" if out is None else out.stem


def _parse(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    described = "With MANIFEST.json; may be given again. Without it, the project's own scenes."
    parser.add_argument("--scenes", action="append", default=[], type=Path, metavar="FOLDER", help=described)
    parser.add_argument("--work", type=Path, help="Where dumps, labels, networks and scores are kept.")
    parser.add_argument("--size", type=_size, default=_size(SIZE), metavar="WxH", help=f"Of the views: {SIZE}.")
    parser.add_argument("--views", type=int, default=2, help="Most views of a stage, in each mode.")
    parser.add_argument("--folds", type=int, default=5, help="Parts of the assets, each held out once.")
    parser.add_argument("--parts", nargs="+", choices=PARTS, default=list(PARTS), metavar="PART", help=", ".join(PARTS))
    parser.add_argument("--variants", nargs="+", metavar="NAME", help="These variants only.")
    add_outputs(parser)
    parser.add_argument("--page-only", action="store_true", help="Nothing is measured: the page of what is in --out.")
    given = parser.parse_args(arguments)
    if given.page_only and given.out is None:
        parser.error("--page-only needs --out")
    if given.work is None and not given.page_only:
        parser.error("--work is missing: a folder for dumps, labels, networks and scores")
    unknown = set(given.variants or ()) - set(variants())
    if unknown:
        parser.error(f"no variants {', '.join(sorted(unknown))}; there are {', '.join(variants())}")
    return given


def _size(text: str) -> tuple[int, int]:
    width, _, height = text.partition("x")
    return int(width), int(height)


if __name__ == "__main__":
    sys.exit(main())
