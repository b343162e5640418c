"""The renderer, measured: capture against bare rasterising, reuse of a scene, whole frames by pass.

python -m benchmarks.renderer --bundle FOLDER --out benchmarks/results/renderer.json --page benchmarks/RENDERER.md
"""

from __future__ import annotations

import argparse
import sys
from contextlib import nullcontext
from pathlib import Path
from typing import Any

from benchmarks import provenance
from benchmarks.outputs import add_outputs, write_figures, write_page
from benchmarks.render import measure
from benchmarks.render.bundle import random_bundle
from benchmarks.render.page import page
from benchmarks.render.setup import subjects
from renderer.context import describe, gl_context

PARTS = ("capture", "views", "frames")


def main() -> int:
    """Measures what was asked for, writes the figures and the page."""
    arguments = _parse()
    ctx = gl_context()
    found: dict[str, Any] = {
        **provenance.head("benchmarks.renderer"),
        "driver": describe(ctx),
        "bundle": "random weights" if arguments.bundle is None else "given",
        **{part: [] for part in arguments.parts},
    }
    trained: Path | None = arguments.bundle
    with provenance.load_around(found), nullcontext(trained) if trained is not None else random_bundle(ctx) as bundle:
        for subject in subjects(ctx, tuple(arguments.scenes)):
            print(f"{subject.name}: {', '.join(arguments.parts)}", file=sys.stderr, flush=True)
            if "capture" in arguments.parts:
                found["capture"].append(measure.capture_cost(subject, arguments.rounds))
            if "views" in arguments.parts:
                found["views"].append(measure.second_view(subject, arguments.rounds))
            if "frames" in arguments.parts:
                found["frames"].append(measure.frame_costs(subject, bundle, arguments.rounds))
    text = page(found)
    print(text)
    write_figures(arguments.out, found)
    write_page(arguments.page, text)
    return 0


def _parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--parts", nargs="+", choices=PARTS, default=list(PARTS))
    parser.add_argument("--scenes", nargs="+", choices=("thicket", "sponza"), default=["thicket", "sponza"])
    parser.add_argument("--rounds", type=int, default=9, help="Rounds of what is measured in turns.")
    parser.add_argument("--bundle", type=Path, help="Folder of a trained bundle; without it, random weights.")
    add_outputs(parser)
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
