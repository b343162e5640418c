"""`diaphane dataset`: data sets of label shards on this machine."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from diaphane.cli import output
from diaphane.cli.lines import plain, print_columns, size
from diaphane.cli.state import JsonOption

if TYPE_CHECKING:
    from labeller.inspection import Bin, Inspection

BAR = 40
"""Characters of the longest bar."""

app = typer.Typer(
    help="Data sets of label shards on this machine: inspect. (`diaphane datasets` is about those on a server.)",
    no_args_is_help=True,
)


@app.callback()
def _group() -> None:
    """Keeps `inspect` a command of its own while it is the only one."""


@app.command()
def inspect(
    path: Annotated[
        Path, typer.Argument(help="A shard, an index.json, the folder of one, or a folder with a build's artifacts.")
    ],
    as_json: JsonOption = False,
) -> None:
    """Verify every byte of a data set, and tell what is in it: counts, histograms of n, of gains and of budgets."""
    from labeller.inspection import inspect as run

    found = run(path)
    if as_json:
        output.print_json(found.model_dump(mode="json"))
    else:
        _show(found)


def _show(found: Inspection) -> None:
    verified = "every shard verified against the index" if found.indexed else "no index: every shard verified by itself"
    print(f"{plain(found.path)}: {verified}" + (f", code {plain(found.code[:12])}" if found.code else ""))
    rows = [
        (
            name,
            split.shards,
            len(split.assets) or None,
            *(f"{count:,}" for count in (split.fragments, split.rows, split.exact_rows, split.segments)),
            size(split.bytes),
        )
        for name, split in found.splits.items()
    ]
    print_columns(("split", "shards", "assets", "fragments", "rows", "already exact", "hull segments", "size"), rows)
    for name, split in found.splits.items():
        if split.assets:
            print(f"{name}: {plain(', '.join(split.assets))}")
    _histogram("Rows by n, fragments of the pixel", [_whole(bin_) for bin_ in found.n], found.n)
    gains = [f"1e{_power(bin_.low)}..1e{_power(bin_.high)}" for bin_ in found.gains]
    _histogram("Hull segments by gain, squared error saved per fragment", gains, found.gains)
    budgets = [f"{100 * bin_.low:.0f}..{100 * bin_.high:.0f} %" for bin_ in found.budgets]
    _histogram("Budgets with an optimal allocation, by F / N", budgets, found.budgets)
    if found.log10_lambda is not None:
        low, high = found.log10_lambda
        prices = f"{found.short_budgets} have a price lambda, from 1e{low:.1f} to 1e{high:.1f}"
        print(f"{prices} squared error per fragment; at the others all that can be gained fits.")


def _histogram(title: str, names: Sequence[str], bins: Sequence[Bin]) -> None:
    """Bars as long as their share of the greatest one; something is never nothing."""
    print(f"\n{title}")
    most = max((bin_.count for bin_ in bins), default=0)
    width = max(map(len, names), default=0)
    digits = len(f"{most:,}")
    for name, bin_ in zip(names, bins, strict=True):
        bar = "#" * max(round(BAR * bin_.count / most), 1) if bin_.count else ""
        print(f"  {name:>{width}}  {bin_.count:>{digits},}  {bar}".rstrip())
    if not bins:
        print("  none")


def _whole(bin_: Bin) -> str:
    low, last = int(bin_.low), int(bin_.high) - 1
    return str(low) if low == last else f"{low}..{last}"


def _power(value: float) -> int:
    from math import log10

    return round(log10(value))
