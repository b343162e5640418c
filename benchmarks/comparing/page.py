"""The suite's results as a page that reads like a paper's evaluation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from benchmarks.comparing import tables
from benchmarks.comparing.scenes import BUNDLE, PATH_FRAMES
from benchmarks.comparing.work import work
from evaluation.bench.cells import bundle_of
from evaluation.bench.groups import Group, groups_of, said_setting
from evaluation.bench.page import said_machines
from evaluation.bench.plots import budget_chart
from evaluation.report.vega import svg
from evaluation.summary import UNFIT, said_unfit
from schemas.bench import BenchResult, BenchView

PAPER = ("minecraft_village_caves", 2.0), ("sponza", 4.0)
"""DHOIT's two rows of Tables 1 and 2: Vokselia Spawn at M = 20 MB, here another voxel scene at F = 2 WH, and Crytek
Sponza at 40 MB, F = 4 WH."""
PAPER_ALPHA = 0.33
"""Opacity of all surfaces there."""
LEARNED = "kbuffer-deep"
"""The technique whose losses the page lists."""
DEEP_FROM = 5.0
"""N / WH from which on a view counts as deep."""
FACTORS = (0.25, 1.0)
"""Of Figure 6."""
USUAL = 1.0
"""F / WH of the tables of all techniques."""


def page(found: Mapping[str, BenchResult], drawn: Mapping[tuple[str, str], str]) -> str:
    """Markdown.

    Args:
        found: Driver -> its results.
        drawn: (driver, figure) -> its file, relative to the page.
    """
    parts = [
        "# Every technique, measured\n",
        "`make bench` measures what is missing and writes this page; it can be stopped and goes on. "
        "`python -m benchmarks.suite --help` has its parts: single scenes, sizes, opacities, `--quick`.\n",
        "MSE is ×1e-5, as displayed (clamped 8-bit sRGB in [0,1]), over the whole image on white, against the exact "
        "picture that the CPU composites from all fragments in float64. *q* is (MSE + 1e-7) / (MSE of the oracle + "
        '1e-7); the oracle is DHOIT\'s "optimal k-buffer", Algorithm 1, offline, with the weighted-average tail; the '
        "*certified optimum* is the least error that any allocation of the budget has with the technique's own tail. "
        "At *equal memory* each technique gets the total bytes that the fixed k-buffer takes with F = k WH, and F is "
        "what its own buffers leave of it (DHOIT, Eq. 1). Times are medians of repeats in which all techniques take "
        "turns, by a clock that waits for each pass, which the next section names; readbacks are a pass of their own; "
        "the spread is the largest of (most - least) / median. Flicker is that of `diaphane bench`, over a path of "
        f"{PATH_FRAMES} frames. Means over views are geometric for errors, arithmetic else; "
        "errors and scores are over the views that no budget holds entirely, so that every budget averages the same. "
        "`kbuffer-temporal` learns from the frames before: it is measured at rest and in motion in "
        "[TEMPORAL.md](TEMPORAL.md).\n",
    ]
    for driver, result in found.items():
        parts += _driver(driver, result, drawn)
    return "\n".join(parts)


def pictures(result: BenchResult) -> dict[str, str]:
    """Figure 6 as SVG files: name -> text."""
    made = {
        _figure(views, factor): budget_chart(groups_of(views), factor)
        for views in _settings(result)
        for factor in FACTORS
    }
    return {name: svg(spec, width=800) for name, spec in made.items() if spec is not None}


def _driver(driver: str, result: BenchResult, drawn: Mapping[tuple[str, str], str]) -> list[str]:
    views, settings = result.views, _settings(result)
    parts = [f"## {driver}\n", *(f"{line}.\n" for line in said_machines(views))]
    parts.append(_what(result))
    for first in settings:
        parts += _errors(driver, first, drawn)
    parts.append("### Score q, all views\n")
    parts.append(tables.scores(views))
    parts.append("By opacity and size, budgets ascending; a dash where the budget holds every view entirely:\n")
    parts.append(tables.scores_by_setting(views))
    paper = next((each for each in settings if each[0].alpha == PAPER_ALPHA), settings[0])
    parts.append(_tables_of_the_paper(groups_of(paper)))
    for first in settings:
        where = f"{said_setting(first[0])}, bounded ones at F = {USUAL:g} WH"
        parts += [f"### Every technique ({where})\n", tables.everything(first, USUAL)]
        if counted := work(first, USUAL, result.device):
            parts += [f"### What a frame does ({where})\n", counted]
    parts.append("### Where each wins\n")
    parts.append(
        "On how many of the scenes (each opacity and size apart) a technique is on a Pareto front (no other has "
        "less of one and no more of the rest), and how often it has the least error of a budget among those that a "
        "renderer can run:\n"
    )
    every = groups_of(views)
    parts.append(tables.winners(every))
    if deep := [each for each in every if each.depth > DEEP_FROM]:
        parts.append(f"On those with N > {DEEP_FROM:g} WH, for which a budget is smaller than all fragments:\n")
        parts.append(tables.winners(deep))
    parts.append(f"Where `{LEARNED}` has more than {tables.ALIKE:g} times the least error of a budget:\n")
    parts.append(tables.losses(every, LEARNED))
    parts.append("### How deep the scenes are\n")
    parts.append(
        "N: transparent fragments; D: those of the fullest pixel; occupied: pixels that have any. Then the total bytes "
        f"that the exact techniques need for a frame; {UNFIT} {said_unfit()}. Peeling draws a scene D times: it is not "
        "measured on the deep ones.\n"
    )
    parts.append(tables.depths(every))
    return parts


def _errors(driver: str, views: Sequence[BenchView], drawn: Mapping[tuple[str, str], str]) -> list[str]:
    """Figure 6 of one setting, and its numbers."""
    parts = [f"### Figure 6: squared error within a budget ({said_setting(views[0])})\n"]
    for factor in FACTORS:
        if (file := drawn.get((driver, _figure(views, factor)))) is not None:
            parts.append(f"F = {factor:g} WH:\n\n![Squared error within F = {factor:g} WH, by scene]({file})\n")
            parts.append(f"F = {factor:g} WH; the least of what a renderer can run is bold:\n")
            parts.append(tables.errors(groups_of(views), factor))
    return parts


def _figure(views: Sequence[BenchView], factor: float) -> str:
    """Name of Figure 6 of one setting."""
    one = views[0]
    setting = "authored" if one.alpha is None else f"alpha{one.alpha:g}"
    return f"figure6-{setting}-{one.width}x{one.height}-{factor:g}"


def _what(result: BenchResult) -> str:
    views = result.views
    hours = sum(view.seconds for view in views) / 3600.0
    cells = [cell for view in views for cell in view.cells if cell.repeats]
    usual = max((cell.repeats for cell in cells), default=0)
    slow = {cell.technique for cell in cells if cell.repeats < usual}
    lines = [f"{len(views)} views of {len({view.scene for view in views})} scenes, {hours:.1f} h of measuring."]
    lines.append(f"Bundle: {result.bundle}.")
    if result.bundle == bundle_of(BUNDLE).label:
        lines.append("It was trained on none of these scenes (`python -m benchmarks.comparing.bundle`).")
    else:
        lines.append(
            "It is not the bundle in `benchmarks/bundle`, and the frames are those of the commits above: "
            "`make bench` with `--fresh` measures both as they are now."
        )
    loads = [load for view in views for load in view.load]
    lines.append(f"Load average of the machine around a view: {min(loads):.1f} to {max(loads):.1f}.")
    if slow:
        lines.append(
            f"{usual} timed frames a cell, fewer where they would take too long (a single one if that alone does): "
            f"{', '.join(sorted(slow))}."
        )
    lines += result.left_out
    return " ".join(lines) + "\n"


def _tables_of_the_paper(groups: Sequence[Group]) -> str:
    named = {tables.scene_of(each): each for each in groups}
    rows = [(named[scene], factor) for scene, factor in PAPER if scene in named]
    # Where the shared scenes are missing, any other shows the same.
    rows = rows or [(groups[0], USUAL)]
    parts = []
    for number, write, about in (
        (1, tables.stages, "milliseconds of the stages"),
        (2, tables.captured, "k(p) and captured fragments"),
    ):
        parts.append(f"### Table {number}: {about}\n")
        for each, factor in rows:
            most = max(view.most for view in each.views)
            parts.append(f"{tables.scene_of(each)}, F = {factor:g} WH, D = {most}:\n")
            parts.append(write(each, factor))
    return "\n".join(parts)


def _settings(result: BenchResult) -> list[list[BenchView]]:
    """Views of each opacity and size, in the order in which they were measured."""
    found: dict[tuple[float | None, int, int], list[BenchView]] = {}
    for view in result.views:
        found.setdefault((view.alpha, view.width, view.height), []).append(view)
    return list(found.values())
