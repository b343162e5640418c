"""What a benchmark leaves in its folder besides the lines of `services.bench.kept`."""

from __future__ import annotations

import json
from pathlib import Path

from schemas.bench import BenchResult
from services.bench.groups import groups_of
from services.bench.page import page
from services.bench.plots import specifications
from services.bench.run import check_same_code
from services.writing import replacing

RESULT = "bench.json"
PAGE = "index.html"


def write_files(folder: Path, result: BenchResult) -> None:
    """`bench.json`, the Vega-Lite plots and the page, each complete or as it was before."""
    plots = specifications(groups_of(result.views))
    texts = {
        RESULT: result.model_dump_json(indent=1, exclude_defaults=True),
        **{name: json.dumps(plot, indent=1) for name, plot in plots.items()},
        PAGE: page(result, list(plots), check_same_code(result)),
    }
    for name, text in texts.items():
        with replacing(folder / name) as path:
            path.write_text(text + "\n", encoding="utf-8")
