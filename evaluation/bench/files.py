"""What a benchmark leaves in its folder besides the lines of `evaluation.bench.kept`."""

from __future__ import annotations

import json
from pathlib import Path

from evaluation.bench.groups import groups_of
from evaluation.bench.page import page
from evaluation.bench.plots import specifications
from evaluation.bench.run import check_same_code
from evaluation.report.vega import svg
from evaluation.writing import replacing
from schemas.bench import BenchResult

RESULT = "bench.json"
PAGE = "index.html"


def write_files(folder: Path, result: BenchResult) -> None:
    """`bench.json`, the charts as Vega-Lite and as SVG, and the page, each complete or as it was before."""
    plots = specifications(groups_of(result.views))
    texts = {
        RESULT: result.model_dump_json(indent=1, exclude_defaults=True),
        **{f"{name}.vl.json": json.dumps(spec, indent=1) for name, spec in plots.items()},
        **{f"{name}.svg": svg(spec).rstrip() for name, spec in plots.items()},
        PAGE: page(result, list(plots), check_same_code(result), folder),
    }
    for name, text in texts.items():
        with replacing(folder / name) as path:
            path.write_text(text + "\n", encoding="utf-8")
