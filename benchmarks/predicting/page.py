"""The figures of `benchmarks.predictors` as a page, and its plots."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final

from benchmarks import markdown
from benchmarks.casting.cases import MODES
from benchmarks.predicting.summary import cost_of, front, score
from benchmarks.predicting.views import MOST_SHARE, MULTIPLES
from benchmarks.provenance import said
from evaluation.report.lines import Points, log_log
from evaluation.report.vega import svg

Found = Mapping[str, Any]

_PLOTS: Final = {
    "multiply-adds": ("multiply-adds a pixel", "multiply_adds"),
    "bytes": ("bytes a pixel beside the pool", "early_bytes"),
}
"""What scores are drawn against: end of the file's name -> title and cost."""

_HEAD = """\
# Predictors, measured

```
python -m benchmarks.predictors{options} --work FOLDER \\
    --out benchmarks/results/{name}.json --page benchmarks/{page}.md
```

**Score.** `q = (MSE + 1e-7) / (MSE of the oracle + 1e-7)` of a view at F = W H x {multiples},
where F < {share:g} N. The oracle is DHOIT's own optimal k-buffer: Algorithm 1, offline, with its tail and its
k_min = 1. Tables give geometric means over views; *score* is that of a row's columns. Below 1 is better than the
oracle. Errors are of what a frame does with a network's curves: whole bins within the budget, the other fragments by
the tail, every pixel, in display space.

**Unseen.** Every asset is held out once: networks are trained on the assets of the other folds and scored on it.
Held-out assets have no say in a training, not even in when it ends. Trained on are also views whose materials have
opacities drawn at random; those are never scored.

**Worse.** Cells (view and budget) with more than 1.05 times the error of the best of VKB, the k+-buffer and fixed k
with the same tail, where one of the two is above 1e-7.

**Cost.** Multiply-adds of one run of the network; bytes a pixel: *gather* is all that is alive while bins and colours
are gathered and the network runs, *capture* all beside the pool while fragments are captured, *peak* the larger of
both at F = W H, the pool included.
"""


def page(found: Found, name: str) -> str:
    """Markdown of what was measured.

    Args:
        found: The figures.
        name: Of their file, without its suffix.
    """
    multiples = ", ".join(f"{m:g}" for m in MULTIPLES)
    head = _HEAD.format(
        options=_options(found["setting"]), name=name, page=name.upper(), multiples=multiples, share=MOST_SHARE
    )
    parts = [head, _circumstances(found)]
    variants: Mapping[str, Found] = found["variants"]
    if variants:
        parts += [_sizes(variants, name), *(_scores(variants, mode) for mode in MODES)]
    if "rules" in found:
        parts += [_rules(found["rules"], mode) for mode in MODES]
    if variants:
        parts.append(_assets(variants, min(variants, key=lambda name: score(variants[name]["q"]))))
    return "\n".join(parts)


def plots(found: Found, name: str) -> dict[str, str]:
    """SVG files by name.

    Args:
        found: The figures.
        name: Of their file, without its suffix.
    """
    variants = found["variants"]
    made = {}
    for file, (title, cost) in _PLOTS.items() if variants else ():
        points = {variant: (float(row["cost"][cost]), score(row["q"])) for variant, row in variants.items()}
        series: dict[str, Points] = {"front": [points[variant] for variant in front(points)]}
        for tail in sorted({row["tail"] for row in variants.values()}):
            series[tail] = [points[variant] for variant, row in variants.items() if row["tail"] == tail]
        made[f"{name}-{file}.svg"] = svg(
            log_log(
                f"Score against {title}",
                (title, "score (1: DHOIT's oracle)"),
                series,
                proportional=False,
                apart=[tail for tail in series if tail != "front"],
            )
        )
    return made


def _sizes(variants: Mapping[str, Found], file: str) -> str:
    points = {
        name: (row["cost"]["multiply_adds"], cost_of(row).peak_bytes(1.0), score(row["q"]))
        for name, row in variants.items()
    }
    kept = front(points)
    heads = ("", "score", "worse", "weights", "multiply-adds", "gather", "capture", "peak", "worst q")
    table = markdown.table(heads, (_size(name, row, name in kept) for name, row in variants.items()))
    drawn = "\n\n".join(f"![Score against {cost}](results/{file}-{cost}.svg)" for cost in _PLOTS)
    return (
        "## Tails and sizes\n\nIn bold what no other one equals or betters in multiply-adds, peak bytes and score.\n\n"
        f"{table}\n{drawn}\n"
    )


def _size(name: str, row: Found, is_on_front: bool) -> tuple[str, ...]:
    cost = cost_of(row)
    return (
        f"**{name}**" if is_on_front else name,
        _number(score(row["q"])),
        f"{row['worse']} of {row['cells']}",
        *(f"{value:,}" for value in (cost.weights, cost.multiply_adds, cost.early_bytes, cost.free_slots)),
        f"{cost.peak_bytes(1.0):g}",
        _worst(row["worst"]),
    )


def _scores(variants: Mapping[str, Found], mode: str) -> str:
    heads = ("", *(f"q x{m:g}" for m in MULTIPLES), *(f"/ optimum x{m:g}" for m in MULTIPLES))
    rows = ((name, *_numbers(row["q"][mode]), *_numbers(row["of optimum"][mode])) for name, row in variants.items())
    return f"## Scores, {mode}\n\nThe optimum is the certified one of whole bins.\n\n{markdown.table(heads, rows)}"


def _rules(rules: Sequence[Found], mode: str) -> str:
    heads = ("tail", "rule", *(f"q x{m:g}" for m in MULTIPLES), "worst q of all")
    rows = ((row["tail"], row["rule"], *_numbers(row["q"][mode]), _worst(row["worst"])) for row in rules)
    return (
        f"## Without a network, {mode}\n\nOn the same fragments: the optimum is offline and certified; `importance` is "
        f"VKB, `dynamic` the k+-buffer, both of any k.\n\n{markdown.table(heads, rows)}"
    )


def _assets(variants: Mapping[str, Found], name: str) -> str:
    assets: Mapping[str, Sequence[float | None]] = variants[name]["assets"]
    worst_first = sorted(assets, key=lambda asset: -score({"": assets[asset]}))
    heads = ("asset", *(f"q x{m:g}" for m in MULTIPLES))
    table = markdown.table(heads, ((asset, *_numbers(assets[asset])) for asset in worst_first))
    return f"## Every asset, held out\n\nWorst first, by `{name}`, the best score, both modes.\n\n{table}"


def _options(setting: Found) -> str:
    """How it was asked for."""
    width, height = setting["size"]
    scenes = "".join(f" --scenes {folder}" for folder in setting["scenes"])
    return f"{scenes} --size {width}x{height} --views {setting['most']} --folds {setting['folds']}"


def _circumstances(found: Found) -> str:
    about = found["setting"]
    width, height = about["size"]
    return (
        f"{about['assets']} assets, {about['views']} views at {width}x{height}, {about['scored']} of them scored (at "
        f"most {about['most']} of a stage and mode: opacity .33 of every surface, and the scene's own), "
        f"{about['folds']} folds. *{said(found)}.*\n"
    )


def _worst(worst: Found) -> str:
    return f"{_number(worst['q'])} ({worst['asset']}, {worst['mode']}, x{worst['multiple']:g})"


def _numbers(values: Iterable[float | None]) -> tuple[str, ...]:
    return tuple(map(_number, values))


def _number(value: float | None) -> str:
    if value is None or math.isnan(value):
        return "-"
    return f"{value:.2g}" if value < 0.1 else f"{value:.3f}" if value < 1.0 else f"{value:.3g}"
