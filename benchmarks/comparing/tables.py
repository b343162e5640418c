"""Markdown tables of the suite, each as one function of a result's groups."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence

from benchmarks.markdown import table
from evaluation.bench.groups import (
    ORACLE_WORDS,
    Group,
    Row,
    group,
    measured,
    offline,
    said_setting,
    said_technique,
    title_of,
)
from evaluation.looks import title
from evaluation.summary import ORACLE, UNFIT, e5, geometric_mean, mean, number
from renderer.techniques import TECHNIQUES
from schemas.bench import Basis, BenchView

FEATURES, IMPORTANCE, BUFFER, READBACK = "feature extraction", "importance", "k-buffer", "readback"
STAGES = (FEATURES, IMPORTANCE, BUFFER, READBACK)
"""DHOIT's stages (Table 1), and what it does not time."""
_BUFFER = {"opaque", "count", "prefix", "chain", "chain-depth", "chain-colour", "resolve"}
NOT_MEASURED = "–"
ALIKE = 1.05
"""Times the least error that counts as the least."""


def stage_of(name: str) -> str:
    """DHOIT's stage that a pass belongs to: all between the sums and the buffer is what chooses k."""
    if name == READBACK:
        return READBACK
    if name in _BUFFER:
        return BUFFER
    return FEATURES if name.startswith("gather") else IMPORTANCE


def depths(groups: Sequence[Group]) -> str:
    """How deep each scene is, and the bytes that each exact technique needs for it, in one go."""
    exact = [name for name, entry in TECHNIQUES.items() if entry.family == "exact"]
    lines = []
    for each in sorted(groups, key=lambda group: group.depth):
        needed = {row.key.technique: row for row in each.rows if row.key.technique in exact}
        occupied = mean([view.occupied / (view.width * view.height) for view in each.views]) or 0.0
        most = max(view.most for view in each.views)
        cells = [_needed(needed.get(name)) for name in exact]
        lines.append([each.title, f"{each.depth:.1f}", most, f"{100.0 * occupied:.0f} %", *cells])
    return table(("scene", "N / WH", "D", "occupied", *(f"{name}, MiB" for name in exact)), lines)


def _needed(row: Row | None) -> str:
    if row is None or row.total_bytes is None:
        return NOT_MEASURED
    return f"{row.total_bytes / 2**20:.0f}" + ("" if row.fits else f" {UNFIT}")


def errors(groups: Sequence[Group], factor: float) -> str:
    """Figure 6 in numbers: MSE x1e-5 of the bounded techniques and the offline allocations, a line a scene."""
    names = _names(groups, "fragments")
    marks = list(dict.fromkeys(mark.rule for each in groups for mark in offline(each)))
    lines = []
    for each in groups:
        found = {said_technique(row.key): row.mse for row in _at(each, factor)}
        best = {mark.rule: mark.mse for mark in offline(each) if mark.budget_factor == factor}
        least = min((mse for name, mse in found.items() if mse and title(ORACLE) not in name), default=None)
        cells = [_bold(found.get(name), None if title(ORACLE) in name else least) for name in names]
        lines.append([scene_of(each), *cells, *(e5(best.get(mark)) for mark in marks)])
    return table(("scene", *names, *marks), lines)


def stages(each: Group, factor: float) -> str:
    """Table 1: milliseconds of DHOIT's stages on a scene; by the GPU's timer in brackets where it is right."""
    lines = []
    for row in _at(each, factor):
        host = {stage: sum(ms for name, ms in row.passes.items() if stage_of(name) == stage) for stage in STAGES}
        gpu = {stage: sum(ms for name, ms in row.gpu.items() if stage_of(name) == stage) for stage in STAGES}
        cells = [f"{host[s]:.2f}" + (f" ({gpu[s]:.2f})" if row.gpu and s != READBACK else "") for s in STAGES]
        lines.append([said_technique(row.key), *cells, number(row.ms)])
    return table(("ms", *STAGES, "frame"), lines)


def captured(each: Group, factor: float) -> str:
    """Table 2: k(p) and captured fragments on a scene."""
    lines = []
    for row in _at(each, factor):
        if row.k is not None and row.captured is not None:
            share = f"{row.captured / 1e6:.2f} M ({100 * (row.of_all or 0):.0f} %)"
            lines.append([said_technique(row.key), f"{row.k[0]}–{row.k[1]}", share])
    for mark in offline(each):
        if mark.budget_factor == factor and mark.rule.startswith(ORACLE_WORDS):
            lines.append([mark.rule, f"{mark.k[0]}–{mark.k[1]}", f"{mark.captured / 1e6:.2f} M"])
    return table(("technique", "k(p)", "fragments"), lines)


def scores(views: Sequence[BenchView]) -> str:
    """Q over all views, at equal fragments and at equal memory: geometric mean, and the worst view."""
    whole = group("", views)
    factors = sorted({row.key.budget_factor for row in whole.rows if row.key.budget_factor})
    head = ["technique"]
    head += [f"F = {f:g} WH" for f in factors] + ["worst"] + [f"M of k = {f:g}" for f in factors]
    head.append("over the certified optimum, F = " + " / ".join(f"{f:g}" for f in factors) + " WH")
    lines = []
    for name in _names([whole], "fragments"):
        of = [row for row in whole.rows if said_technique(row.key) == name]
        by = {(row.key.basis, row.key.budget_factor): row.score for row in of}
        # The fixed k-buffer's memory is what the others are given.
        memory: Basis = "memory" if any(row.key.basis == "memory" for row in of) else "fragments"
        worst = _worst(views, [row for row in of if row.key.basis == "fragments"])
        equal = [number(by.get(("fragments", f))) for f in factors]
        optimum = {row.key.budget_factor: row.over_optimum for row in of if row.key.basis == "fragments"}
        over = " / ".join(number(optimum.get(f)) for f in factors)
        lines.append([name, *equal, worst, *(number(by.get((memory, f))) for f in factors), over])
    return table(head, lines)


def scores_by_setting(views: Sequence[BenchView]) -> str:
    """Q of each opacity and size, a column a technique: geometric means at equal fragments, budgets ascending."""
    names = _names([group("", views)], "fragments")
    lines = []
    for setting in dict.fromkeys(map(said_setting, views)):
        of = [view for view in views if said_setting(view) == setting]
        found: dict[str, dict[float, float | None]] = {name: {} for name in names}
        for row in measured(group("", of).rows, "fragments"):
            found[said_technique(row.key)][row.key.budget_factor or 0.0] = row.score
        cells = [" / ".join(number(by[factor]) for factor in sorted(by)) or NOT_MEASURED for by in found.values()]
        lines.append([setting, len(of), *cells])
    return table(("opacity, size", "scenes", *names), lines)


def everything(views: Sequence[BenchView], factor: float) -> str:
    """All techniques over all views: time, memory, errors, flicker; bounded ones at one budget."""
    whole = group("", views)
    rows = [*measured(whole.rows, "none"), *_at(whole, factor)]
    head = (
        "technique",
        "frame, ms",
        "spread",
        "bytes / pixel",
        "total, MiB",
        "MSE ×1e-5",
        "PSNR",
        "SSIM",
        "FLIP",
        "flicker ×1e-3",
    )
    return table(
        head,
        [
            [
                said_technique(row.key),
                number(row.ms),
                NOT_MEASURED if row.spread is None else f"{100.0 * row.spread:.0f} %",
                NOT_MEASURED if row.pixel_bytes is None else str(row.pixel_bytes),
                NOT_MEASURED if row.total_bytes is None else f"{row.total_bytes / 2**20:.1f}",
                "exact" if row.family == "exact" else e5(row.mse),
                NOT_MEASURED if row.psnr is None else f"{row.psnr:.1f}",
                NOT_MEASURED if row.ssim is None else f"{row.ssim:.4f}",
                NOT_MEASURED if row.flip is None else f"{row.flip:.4f}",
                number(None if row.flicker is None else 1e3 * row.flicker),
            ]
            for row in rows
        ],
    )


def winners(groups: Sequence[Group]) -> str:
    """On how many scenes each technique is on a Pareto front, and how often it has the least error of a budget.

    Where several have the least error, as where all are lossless, each of them counts.
    """
    fronts = {"time, error": (_time,), "bytes, error": (_bytes,), "time, bytes, error": (_time, _bytes)}
    found = {name: Counter[str]() for name in fronts}
    least = Counter[str]()
    for each in groups:
        rows = [*measured(each.rows, "none"), *measured(each.rows, "fragments")]
        rows = [row for row in rows if row.is_runnable and (row.family == "exact" or row.mse is not None)]
        for name, costs in fronts.items():
            points = [(*(cost(row) for cost in costs), row.mse or 0.0) for row in rows]
            found[name].update(
                {said_technique(row.key) for row, at in zip(rows, points, strict=True) if _on(at, points)}
            )
        for factor in {row.key.budget_factor for row in rows if row.key.basis == "fragments"}:
            bounded = [row for row in rows if row.key.basis == "fragments" and row.key.budget_factor == factor]
            best = min(row.mse or 0.0 for row in bounded)
            least.update(said_technique(row.key) for row in bounded if (row.mse or 0.0) == best)
    total = sum(found.values(), least)
    names = sorted(total, key=lambda name: (-total[name], name))
    lines = [[name, *(count[name] for count in found.values()), least[name]] for name in names]
    return table(("technique", *(f"{name}, of {len(groups)}" for name in fronts), "least error of a budget"), lines)


def losses(groups: Sequence[Group], name: str) -> str:
    """Where another technique that a renderer can run has the least error of a budget, by more than `ALIKE`."""
    lost: list[tuple[float, tuple[str, ...]]] = []
    for each in groups:
        rows = [row for row in measured(each.rows, "fragments") if row.is_runnable and row.mse is not None]
        for factor in sorted({row.key.budget_factor or 0.0 for row in rows}):
            found = {said_technique(row.key): row for row in rows if row.key.budget_factor == factor}
            best = min(found, key=lambda one: found[one].mse or 0.0)
            least, own = found[best], found.get(title(name))
            if own is not None and (own.mse or 0.0) > ALIKE * (least.mse or 0.0):
                over = (own.mse or 0.0) / (least.mse or 1.0)
                line = (each.title, f"{factor:g} WH", e5(own.mse), best, e5(least.mse), number(over))
                lost.append((over, line))
    head = ("scene", "F", f"MSE ×1e-5 of {title(name)}", "least by", "MSE ×1e-5", "times")
    return table(head, (line for _, line in sorted(lost, reverse=True))) if lost else "Nowhere.\n"


def _time(row: Row) -> float:
    return math.inf if row.ms is None else row.ms


def _bytes(row: Row) -> float:
    return math.inf if row.total_bytes is None else row.total_bytes


def _on(point: Sequence[float], points: Sequence[Sequence[float]]) -> bool:
    """Whether no other point is at most as much in everything and less in something."""
    return not any(other != point and all(a <= b for a, b in zip(other, point, strict=True)) for other in points)


def scene_of(each: Group) -> str:
    """The scene's name alone."""
    return each.views[0].scene


def _at(each: Group, factor: float) -> list[Row]:
    return [row for row in measured(each.rows, "fragments") if row.key.budget_factor == factor]


def _names(groups: Sequence[Group], basis: str) -> list[str]:
    return list(dict.fromkeys(said_technique(row.key) for each in groups for row in measured(each.rows, basis)))


def _worst(views: Sequence[BenchView], rows: Sequence[Row]) -> str:
    keys = [row.key for row in rows]
    found: dict[str, list[float]] = {}
    for view in views:
        for cell in view.cells:
            if cell.score is not None and cell.key in keys:
                found.setdefault(title_of(view), []).append(cell.score)
    means = {name: geometric_mean(values) or 0.0 for name, values in found.items()}
    if not means:
        return NOT_MEASURED
    worst = max(means, key=lambda name: means[name])
    return f"{number(means[worst])} ({worst})"


def _bold(mse: float | None, least: float | None) -> str:
    return f"**{e5(mse)}**" if mse is not None and mse == least else e5(mse)
