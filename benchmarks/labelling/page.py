"""The figures of the labeller as a page, and its plots."""

from __future__ import annotations

import statistics
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from benchmarks import markdown
from benchmarks.labelling.certified import MOST_GAP
from benchmarks.provenance import said, said_load
from evaluation.report.lines import log_log
from evaluation.report.vega import svg

_TIME_PLOT, _MEMORY_PLOT = "labeller-time.svg", "labeller-memory.svg"
Found = Mapping[str, Any]

_HEAD = """\
# The labeller, measured

```
python -m benchmarks.labeller --out benchmarks/results/labeller.json --page benchmarks/LABELLER.md
```

measures all of it, `--only PART` a part of it. Times are milliseconds on the wall clock, medians (and the least) of
rounds in which everything takes its turn; a view is 1430x960 and its budgets are 25, 40, 50, 60 and 80 % of its N
fragments, unless something else is said.
"""


def page(found: Found) -> str:
    """Markdown of what `benchmarks.labeller` measured, by part."""
    parts = [_HEAD]
    for name, write in _SECTIONS.items():
        if name in found:
            parts.append(write(found[name]["found"]) + "\n" + _circumstances(found[name]))
    return "\n".join(parts)


def plots(found: Found) -> dict[str, str]:
    """SVG files by name."""
    if "linear" not in found:
        return {}
    costs = found["linear"]["found"]["costs"]
    time = {name: [(c["fragments"], statistics.median(c["seconds"])) for c in group] for name, group in _kinds(costs)}
    memory = {name: [(c["fragments"], max(c["peak_bytes"], 1) / 2**20) for c in group] for name, group in _kinds(costs)}
    memory["the dump itself"] = [(c["fragments"], c["dump_bytes"] / 2**20) for c in costs if c["rule"] == "optimal"]
    return {
        _TIME_PLOT: svg(log_log("Time of labelling against the number of fragments", ("fragments", "seconds"), time)),
        _MEMORY_PLOT: svg(
            log_log(
                "Peak memory of labelling against the number of fragments", ("fragments", "MiB above the input"), memory
            )
        ),
    }


def _circumstances(part: Found) -> str:
    quick = " Tiny views: this run only shows that it works." if part["quick"] else ""
    return f"*{said(part)}; {said_load(**part['load_average'])}.{quick}*\n"


def _certified(found: Found) -> str:
    scenes = found["scenes"]
    table = markdown.table(
        ("scene", "stages", "views", "most fragments", "cases", "proven", "worst gap", "greedy", "increment"),
        (
            (
                name,
                str(s["stages"]),
                str(s["views"]),
                f"{s['most fragments']:,}",
                f"{s['decided']:,}",
                f"{s['proven']:,}",
                f"{s['gap']:.1e}",
                _ratio(s["greedy"]),
                _ratio(s["increment"]),
            )
            for name, s in scenes.items()
            if s["cases"]
        ),
    )
    lines = [f"- {name}: {line}" for name, s in scenes.items() for line in s["wrong"]]
    worst = max((s["gap"] for s in scenes.values()), default=0.0)
    total = sum(s["decided"] for s in scenes.values())
    views = sum(s["views"] for s in scenes.values())
    verdict = f"No violation: {total:,} cases of {views:,} views, worst gap {worst:.1e}."
    if found["most_views"] is not None:
        verdict += f" This run took at most {found['most_views']} of the views of a stage."
    empty = sum(s["stages without a view"] for s in scenes.values())
    if empty:
        verdict += f" {empty} stages have nothing that can be drawn."
    if lines:
        verdict = "**Violations:**\n\n" + "\n".join(lines)
    width, height = found["size"]
    return (
        f"## Certificates\n\nEvery view of every scene at {width}x{height}, with opacity .33 of every surface and, "
        "where a scene has transparency, with its own; F = W H x 1, 2, 4 and 25, 40, 60, 80 % of N. "
        "A case is one budget below N. *Gap* is (error - bound) / max(error, 1e-9 a pixel), the bound computed anew "
        "from the curves and the price that the allocation names, not taken from it. *Proven* are the cases in "
        "which the labeller also shows that no allocation is better at all. *Greedy* and *increment*: the largest "
        f"squared error of that rule over that of `optimal`. The command fails if a gap exceeds {MOST_GAP:.0e}, a "
        "claimed bound exceeds what the curves give, `optimal` lies above another rule, or an allocation is "
        "none.\n\n"
        f"{verdict}\n\n{table}"
    )


def _ratio(value: float | None) -> str:
    return "" if value is None else f"{value:.2f}"


def _speed(found: Found) -> str:
    views, copy = found["views"], found["copy_bytes_per_s"]
    names = ("curves", "hulls", "one budget", "five budgets", "all", "curves and greedy")
    times = markdown.table(
        ("view", "fragments", *names, "memory", "memory / dump"),
        (
            (
                row["view"],
                f"{row['fragments']:,}",
                *(_both(row["times"][name]) for name in names),
                f"{row['peak_bytes'] / 2**20:.0f} MiB",
                f"{row['peak_bytes'] / row['dump_bytes']:.2f}",
            )
            for row in views
        ),
    )
    moved = markdown.table(
        ("view", "step", "MiB read", "MiB written", "GB/s", "share of the copy's"),
        (_moved(row["view"], name, sides, row["times"], copy) for row in views for name, sides in _steps(row)),
    )
    return (
        "## Speed\n\n*All* is what a view costs: curves, hulls, and the optimal allocations of five budgets with their "
        "certificates. *Memory* is the most that a fresh process of its own needs for that above what it has with the "
        f"dump loaded, results included (VmHWM).\n\n{times}\n"
        "Bytes moved, counted by the arrays that a step goes through (`benchmarks/labelling/traffic.py`), and the rate "
        f"at the median time, against a copy by all cores of {copy / 1e9:.1f} GB/s (read and written):\n\n{moved}"
    )


def _steps(row: Found) -> list[tuple[str, dict[str, int]]]:
    steps = row["traffic"]
    whole = {side: sum(step[side] for step in steps.values()) for side in ("read", "written")}
    return [*steps.items(), ("all", whole)]


def _moved(view: str, name: str, sides: Found, times: Found, copy: float) -> tuple[str, ...]:
    rate = 1e3 * (sides["read"] + sides["written"]) / times[name]["median"]
    mib = [f"{sides[side] / 2**20:.0f}" for side in ("read", "written")]
    return view, name, *mib, f"{rate / 1e9:.1f}", f"{100 * rate / copy:.0f} %"


def _heaps(rows: Sequence[Found]) -> str:
    lines = []
    for row in rows:
        times, curves = row["times"], row["times"]["curves"]["median"]
        for name in ("greedy", "compiled heap", "Python heap"):
            median = times[name]["median"]
            lines.append(
                (
                    row["view"],
                    f"`{name}`" if name == "greedy" else name,
                    _both(times[name]),
                    f"{median / times['greedy']['median']:.1f}",
                    f"{(curves + median) / (curves + times['greedy']['median']):.1f}",
                    "" if name == "greedy" else "yes" if row["equal"][name] else "**no**",
                )
            )
    table = markdown.table(("view", "five budgets by", "ms", "over `greedy`", "with the curves", "equal k"), lines)
    removals = ", ".join(f"{row['removals']:,} of {row['fragments']:,}" for row in rows)
    return (
        "## `greedy` against heaps\n\nAlgorithm 1 for five budgets: a heap removes one fragment after the other "
        f"({removals}) and notes k at each budget; `greedy` makes one selection a budget. The Python heap is "
        "the literal algorithm over plain lists; the compiled one has 64-bit nodes in a 4-ary array heap whose top is "
        "replaced in place (`benchmarks/labelling/heap.py`). All on the same curves in one process, the Python heap "
        "once, between the others' rounds. *With the curves*: the same with the time of the curves added to both sides."
        f"\n\n{table}"
    )


def _linear(found: Found) -> str:
    table = markdown.table(
        ("rule", "bands", "fragments", "s", "ns a fragment", "MiB", "of them k", "MiB / dump", "a band's dump, MiB"),
        (
            (
                c["rule"],
                str(c["bands"]) if c["banded"] else "",
                f"{c['fragments']:,}",
                f"{statistics.median(c['seconds']):.3g}",
                f"{1e9 * statistics.median(c['seconds']) / c['fragments']:.0f}",
                f"{c['peak_bytes'] / 2**20:.0f}",
                f"{4 * len(c['gaps']) * c['pixels'] / 2**20:.0f}",
                f"{c['peak_bytes'] / c['dump_bytes']:.2f}",
                f"{c['largest_bytes'] / 2**20:.0f}" if c["banded"] else "",
            )
            for c in found["costs"]
        ),
    )
    fits = "; ".join(
        f"`{e['rule']}`{' in bands' if e['banded'] else ''} {e['exponent']:.3f}"
        for e in found["exponents"]
        if e["exponent"] is not None
    )
    return (
        "## Growth with N\n\nCurves and five budgets. Without bands: one camera at rising resolutions. With bands: "
        "views all around the same scene, a quarter of one a band, stacked to one tall picture and read from disk "
        "band by band (`labeller.streaming.allocate_bands`; reading is not in the times). Each in a process of its "
        "own; *MiB* is the most it needs above its input. With bands that is one band, its dump and what is made of "
        "it, and of the whole picture the five results (*of them k*, 4 bytes a pixel each) and a count a pixel.\n\n"
        f"![Time against fragments](results/{_TIME_PLOT})\n![Memory against fragments](results/{_MEMORY_PLOT})\n\n"
        f"Exponent of N in the time, fitted from 1e6 fragments on (dashed: exponent 1): {fits or 'too few points'}.\n\n"
        f"{table}"
    )


def _several_g(rows: Sequence[Found]) -> str:
    names = ("one", "1 at once", "2 at once", "4 at once", "8 at once")
    table = markdown.table(
        ("view", *names, "8 over one"),
        (
            (
                row["view"],
                *(_both(row["times"][name]) for name in names),
                f"{row['times']['8 at once']['median'] / row['times']['one']['median']:.2f}",
            )
            for row in rows
        ),
    )
    return (
        "## Several g\n\nCurves of the density tail, of one g and of several in one pass (`error_curves_by_g`).\n\n"
        f"{table}"
    )


def _metrics(rows: Sequence[Found]) -> str:
    metrics = list(dict.fromkeys(name.partition(", ")[2] for name in rows[0]["times"])) if rows else []
    tails = list(dict.fromkeys(name.partition(", ")[0] for name in rows[0]["times"])) if rows else []
    table = markdown.table(
        ("view", "tail", *metrics),
        (
            (row["view"], tail, *(_both(row["times"][f"{tail}, {metric}"]) for metric in metrics))
            for row in rows
            for tail in tails
        ),
    )
    return f"## Tails and metrics\n\nCurves of a view, by tail and metric.\n\n{table}"


_SECTIONS: dict[str, Callable[[Any], str]] = {
    "certified": _certified,
    "speed": _speed,
    "heaps": _heaps,
    "linear": _linear,
    "g": _several_g,
    "metrics": _metrics,
}


def _kinds(costs: Sequence[Found]) -> list[tuple[str, list[Found]]]:
    kinds: dict[str, list[Found]] = {}
    for c in costs:
        kinds.setdefault(f"{c['rule']}, in bands" if c["banded"] else c["rule"], []).append(c)
    return list(kinds.items())


def _both(times: Found) -> str:
    return f"{_ms(times['median'])} ({_ms(times['least'])})"


def _ms(value: float) -> str:
    return f"{value:,.0f}" if value >= 10.0 else f"{value:.2g}"
