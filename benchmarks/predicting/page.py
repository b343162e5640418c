"""The figures of `benchmarks.predictors` as a page, and its plots."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final

from benchmarks import markdown
from benchmarks.labelling.plot import Labels, Points, log_log
from benchmarks.predicting.summary import cost_of, front, score
from benchmarks.predicting.variants import DEFAULT
from benchmarks.provenance import said

Found = Mapping[str, Any]

SMALL, TINY = 1.1, 1.3
"""Score that a `small` and a `tiny` bundle may have, relative to the best."""

_PLOTS: Final = {
    "multiply-adds": ("multiply-adds a pixel", "multiply_adds"),
    "bytes": ("bytes a pixel that the gather pass writes", "feature_bytes"),
}
"""What scores are drawn against: end of the file's name -> title and cost."""

_HEAD = """\
# Predictors, measured

```
python -m benchmarks.predictors --scenes ../shared/scenes --work FOLDER{options} \\
    --out benchmarks/results/{name}.json --page benchmarks/{page}.md
```

**Score.** `q = (MSE + 1e-7) / (MSE of the oracle + 1e-7)` of a view at F = W H x 1, 2, 4 where F < N. The oracle is
DHOIT's own optimal k-buffer: Algorithm 1, offline, with its tail and its k_min = 1. Tables give geometric means over
views; *score* is that of the three columns. Below 1 is better than the oracle. Errors are of the stored fragments
composited with the tail, every pixel of the view, in display space.

**Unseen.** Every asset is held out once: networks are trained on the assets of the other folds and scored on it.
Held-out assets have no say in a training, not even in when it ends.

**Equal memory.** All get 8 F + 64 W H bytes, what fixed k with the `density` tail has needed beside a pool of F slots.
Whoever needs less a pixel has more slots for it; what a gather pass needs before fragments are captured may lie in the
pool's memory. The oracle has F for nothing. A dash: the gather pass alone does not fit.

**Cost.** Multiply-adds of one run of the network; *sums* are bytes a pixel that the gather pass writes, *gather* all
that is alive then, *capture* all that is alive beside the pool while fragments are captured.
"""

_TITLES: Final = {
    "variants": "Tails of the product",
    "bundles": "Sizes of the product",
    "sizes": "Hidden layers",
    "features": "What the network reads",
    "losses": "Training",
    "seeds": "Seeds",
    "labels": "Labels of another tail than the deployed one",
    "presets": "Presets",
    "augmentation": "More to train on",
    "inputs": "Neighbourhoods, views, resolution and feedback",
    "tails": "Tails with something learned",
}

_NOTES: Final = {
    "labels": "Rows with the labels of `density` have no depth bins either: compare with the network that reads none.",
    "losses": (
        "`distilled`: a `small` network learns the gains that the `full` one of the same fold answers where that stops "
        "at the drawn prices, alone or half and half with the regret. `weights of FLIP`: pixels weigh in the regret "
        "what FLIP makes of a squared error of theirs (`labeller.flip_weights`); q is of errors without weights."
    ),
    "augmentation": (
        "Beside the views themselves: views of opacity .33 with three other opacities; every view with R, G and B of "
        "each pixel in another order (labels stay as they are); views of opacity .33 from which one half of the coarse "
        "colours is gone, or the other half."
    ),
    "tails": (
        "`density, g from network`, `density-16, factor from network`: a third output says what the exponents of a "
        "pixel's tail are multiplied with, learned by the regret at the count that the network's own curve gives; its "
        "optimum has the best count and the best factor of each pixel. `learned exponents`: 12 hidden units correct "
        "the exponent of every fragment of the tail by what the bins around it hold (their multiply-adds are for each "
        "such fragment); `learned coverage`: the transmittance of a pixel's tail when it is resolved. Both are fitted "
        "to the errors of pictures with the counts of the network without them, and scored with the same counts. "
        "Moments are in the table of tails: four power moments take more bytes than 8 bins, and their optimum is worse."
    ),
    "presets": "DHOIT's network as printed (`paper`: Eq. 3, floor only) and with its labels' scale and fill repaired.",
    "inputs": (
        "Trials in the benchmark only. `neighbourhood`: also 3x3 means of log n and optical depth; `view-means`: means "
        "over the view; `view-normalised`: features relative to their view. `half-resolution`, `quarter-resolution`: "
        "sums and nearest fragment are gathered for one pixel in each block of 2x2 or 4x4; n, depth range, optical "
        "depth and bins are every pixel's own. Feedback: after a frame, every pixel's "
        "curve is moved half the way to what its last core fragment gained, once or twice, and the frame is solved "
        "again. `error`: the gain itself, which nobody knows in a frame; `colour`: how much the pixel's colour changed."
    ),
}


def page(found: Found, name: str) -> str:
    """Markdown of what was measured.

    Args:
        found: The figures.
        name: Of their file, without its suffix.
    """
    parts = [_HEAD.format(options=_options(found["setting"]), name=name, page=name.upper()), _circumstances(found)]
    variants: Mapping[str, Found] = found["variants"]
    if variants:
        parts += [_sizes(variants, name), _parts(variants)]
    if "rules" in found:
        parts.append(_rules(found["rules"]))
    if "tails" in found:
        parts.append(_tails(found["tails"]))
    if DEFAULT in variants:
        parts.append(_assets(variants, [name for name in (DEFAULT, "density-8", "density") if name in variants]))
    return "\n".join(parts)


def plots(found: Found, name: str) -> dict[str, str]:
    """SVG files by name.

    Args:
        found: The figures.
        name: Of their file, without its suffix.
    """
    variants = {name: row for name, row in found["variants"].items() if row["is_product"]}
    if not variants:
        return {}
    made = {}
    for file, (title, cost) in _PLOTS.items():
        points = {variant: (float(row["cost"][cost]), score(row["q"])) for variant, row in variants.items()}
        series: dict[str, Points] = {"front": [points[variant] for variant in front(points)]}
        for tail in sorted({row["tail"] for row in variants.values()}):
            series[tail] = [points[variant] for variant, row in variants.items() if row["tail"] == tail]
        labels = Labels(f"Score against {title}", title, "score (1: DHOIT's oracle)")
        made[f"{name}-{file}.svg"] = log_log(
            labels, series, proportional=False, apart=[tail for tail in series if tail != "front"]
        )
    return made


def proposals(variants: Mapping[str, Found]) -> dict[str, str]:
    """Bundle sizes -> variants: the best one, and the cheapest (multiply-adds times bytes) that come near it.

    Args:
        variants: Those that the product could ship.
    """
    scores = {name: score(row["q"]) for name, row in variants.items()}
    best = min(scores.values())
    made = {}
    for size, factor in (("tiny", TINY), ("small", SMALL), ("full", 1.0)):
        near = [name for name, value in scores.items() if value <= factor * best]
        made[size] = min(near, key=lambda name: (_price(variants[name]), scores[name]))
    return made


def _price(row: Found) -> int:
    """Of no unit, so that neither of the two costs has to be weighed against the other."""
    return int(row["cost"]["multiply_adds"] * row["cost"]["gather_bytes"])


def _sizes(variants: Mapping[str, Found], file: str) -> str:
    shipped = {name: row for name, row in variants.items() if row["is_product"]}
    if not shipped:
        return ""
    points = {
        name: (row["cost"]["multiply_adds"], row["cost"]["gather_bytes"], score(row["q"]))
        for name, row in shipped.items()
    }
    proposed = proposals(shipped)
    lines = "\n".join(f"- `{size}`: {name}" for size, name in proposed.items())
    drawn = "\n\n".join(f"![Score against {cost}](results/{file}-{cost}.svg)" for cost in _PLOTS)
    chosen = sorted(front(points), key=lambda name: points[name])
    return (
        "## Sizes\n\nWhat these figures alone propose: `full` has the best score; `small` and `tiny` have the least "
        f"product of multiply-adds and bytes while gathering, of those within {100 * (SMALL - 1):.0f} % and "
        f"{100 * (TINY - 1):.0f} % of its score.\n\n{lines}\n\n"
        "The bundle's sizes, chosen on pictures of 715x480, are the rows that begin with `tiny` (reads what a binned "
        "tail keeps of a pixel anyway), `small` (leaves out the sums that gain nothing beside depth bins) and `full` "
        f"(reads all).\n\n{drawn}\n\n"
        "No other variant of the product is at least as good as one of these in multiply-adds, bytes while gathering "
        f"and score:\n\n{markdown.table(_COLUMNS, (_row(name, shipped[name]) for name in chosen))}"
    )


def _parts(variants: Mapping[str, Found]) -> str:
    spread = _spread(variants)
    sections = []
    for part, title in _TITLES.items():
        rows = {name: row for name, row in variants.items() if row["part"] == part}
        if not rows:
            continue
        bases = {row["base"]: None for row in rows.values() if row["base"] in variants and row["base"] not in rows}
        listed = {**{name: variants[name] for name in bases}, **rows}
        table = markdown.table(
            (*_COLUMNS, "against", "change"),
            ((*_row(name, row), *_change(row, variants, spread)) for name, row in listed.items()),
        )
        note = f"{_NOTES[part]}\n\n" if part in _NOTES else ""
        sections.append(f"## {title}\n\n{note}{table}{_flip(rows)}")
    if spread is not None:
        sections.append(f"Seeds alone move the score by {100 * spread:.1f} %; a change below that is marked ~.\n")
    return "\n".join(sections)


def _flip(rows: Mapping[str, Found]) -> str:
    """FLIP of the rows that know it, relative to that of what they are compared with."""
    known = {name: row for name, row in rows.items() if "flip / base" in row}
    if not known:
        return ""
    heads = ("mean FLIP over that of", "", "x1", "x2", "x4")
    cells = ((row["base"], name, *_numbers(row["flip / base"])) for name, row in known.items())
    return f"\n{markdown.table(heads, cells)}"


def _spread(variants: Mapping[str, Found]) -> float | None:
    """Largest score of the default's seeds over the least, less 1; None where there is one seed."""
    scores = [score(row["q"]) for name, row in variants.items() if row["part"] == "seeds" or name == DEFAULT]
    return max(scores) / min(scores) - 1.0 if len(scores) > 1 else None


def _change(row: Found, variants: Mapping[str, Found], spread: float | None) -> tuple[str, str]:
    base = variants.get(row["base"])
    if base is None:
        return "", ""
    change = score(row["q"]) / score(base["q"]) - 1.0
    if change > 1.0:
        return row["base"], f"x {change + 1.0:.3g}"
    mark = " ~" if spread is not None and abs(change) <= spread else ""
    return row["base"], f"{100 * change:+.1f} %{mark}"


_COLUMNS: Final = (
    *("", "q x1", "x2", "x4", "score", "/ optimum x1", "x2", "x4", "at memory x1", "x2", "x4"),
    *("weights", "multiply-adds", "sums", "gather", "capture", "worst q"),
)


def _row(name: str, row: Found) -> tuple[str, ...]:
    cost = cost_of(row)
    return (
        name,
        *_numbers(row["q"]),
        _number(score(row["q"])),
        *_numbers(row["of optimum"]),
        *_numbers(row["at memory"]),
        f"{cost.weights:,}",
        f"{cost.multiply_adds:,}",
        *(str(value) for value in (cost.feature_bytes, cost.gather_bytes, cost.capture_bytes)),
        _worst(row["worst"]),
    )


def _rules(rules: Sequence[Found]) -> str:
    table = markdown.table(
        ("tail", "rule", "q x1", "x2", "x4", "score", "at memory x1", "x2", "x4", "gather", "capture", "worst q"),
        (
            (
                row["tail"],
                f"{row['rule']} (offline)" if row["is_offline"] else row["rule"],
                *_numbers(row["q"]),
                _number(score(row["q"])),
                *_numbers(row["at memory"]),
                str(row["cost"]["gather_bytes"]),
                str(row["cost"]["capture_bytes"]),
                _worst(row["worst"]),
            )
            for row in rules
        ),
    )
    return (
        "## Rules without a network, on the same fragments\n\n`optimal` is certified; `greedy` with `weighted-average` "
        f"is the oracle; `importance` is VKB, `dynamic` the k+-buffer.\n\n{table}"
    )


def _tails(tails: Sequence[Found]) -> str:
    table = markdown.table(
        ("tail", "bytes", "optimum x1", "x2", "x4", "proportional x1", "x2", "x4"),
        (
            (row["name"], f"{row['bytes']:g}", *_numbers(row["optimal"]), *_numbers(row["proportional"]))
            for row in sorted(tails, key=lambda row: score(row["optimal"]))
        ),
    )
    return (
        "## Tails\n\nq of the certified optimum under each tail, and of fragments in proportion to n, best first. "
        "*Bytes* are what a tail keeps of a pixel beside its weighted sum. Bins are those of METHOD section 2, finer "
        "in front; *equal* ones equal in depth; *best g*: an oracle chooses the density tail's g of every pixel among "
        f"0, .25, .5, .75, 1 and 1.5, with its k. Names without a description are the product's tails.\n\n{table}"
    )


def _assets(variants: Mapping[str, Found], names: Sequence[str]) -> str:
    assets = variants[names[0]]["assets"]
    rows = (
        (asset, *(text for name in names for text in _numbers(variants[name]["assets"].get(asset, [None] * 3))))
        for asset in sorted(assets, key=lambda asset: -score(assets[asset]))
    )
    heads = [f"{name} x{multiple}" for name in names for multiple in (1, 2, 4)]
    return f"## Every asset, held out\n\nWorst first, by `{names[0]}`.\n\n{markdown.table(('asset', *heads), rows)}"


def _options(setting: Found) -> str:
    """How a smaller run was asked for."""
    width, height = setting["size"]
    return f" --size {width}x{height} --views {setting['most']} --folds {setting['folds']}"


def _circumstances(found: Found) -> str:
    about = found["setting"]
    width, height = about["size"]
    return (
        f"{about['assets']} assets, {about['views']} views at {width}x{height} (at most {about['most']} of a stage and "
        f"mode: opacity .33 of every surface, and the scene's own), {about['folds']} folds. "
        f"*{said(found)}.*\n"
    )


def _worst(worst: Found) -> str:
    return f"{_number(worst['q'])} ({worst['asset']}, x{worst['multiple']})"


def _numbers(values: Iterable[float | None]) -> tuple[str, ...]:
    return tuple(_number(value) for value in values)


def _number(value: float | None) -> str:
    if value is None or math.isnan(value):
        return "-"
    return f"{value:.3f}" if value < 1.0 else f"{value:.2f}" if value < 10.0 else f"{value:.0f}"
