"""What `kbuffer-temporal` gains over `kbuffer-deep` by learning from its last frame, at rest and in motion.

python -m benchmarks.temporal --bundle FOLDER --out benchmarks/results/temporal.json --page benchmarks/TEMPORAL.md

`python -m benchmarks.comparing.bundle` makes a bundle that has seen none of these scenes.
"""

from __future__ import annotations

import argparse
import json
import statistics
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks import provenance
from benchmarks.casting.cases import SHARED
from benchmarks.comparing import scenes as suite
from benchmarks.markdown import table
from benchmarks.outputs import add_outputs, write_figures, write_page
from evaluation.bench.flicker import camera_path, error_change, k_change
from evaluation.bench.measure import over
from evaluation.bench.rounds import shoot
from evaluation.bench.subject import Subject
from evaluation.local_scenes import LocalScene
from renderer.scene import LoadOptions
from renderer.techniques import Budget, Needs, Technique, technique
from renderer.timing import shared_clock
from schemas.bundle import load_manifest
from schemas.colour import display8
from schemas.view import View

SCENES = (*suite.SHARED, "bottles", "foliage", "curtains", "hair_cards")
SIZE = (320, 214)
ALPHA = 0.33
BUDGETS = (1.0, 2.0)
SHOWN = (1, 2, 3, 5, 8)
"""Frames after the first one, of a camera that stands still."""
REST = 9
"""Frames at rest before the camera moves."""
STEPS = (0.1, 0.45, 2.0)
"""Degrees of an orbit's turn from frame to frame."""
MOVING = 6
"""Frames in motion."""
COMPARED = ("kbuffer-deep", "kbuffer-temporal")
STEADY = 1e-5
"""Flicker that nobody sees: a step of an 8-bit value in one value of 400."""

JSON = dict[str, Any]


@dataclass(frozen=True, slots=True)
class Shot:
    """A frame of a technique.

    Attributes:
        error: Mean squared displayed error.
        image: uint8 [H, W, 3], as displayed.
        k: int32 [P].
        ms: Milliseconds of all passes.
    """

    error: float
    image: NDArray[np.uint8]
    k: NDArray[np.int32]
    ms: float


def main() -> int:
    """Measures, and writes the results and their page."""
    given = _parse()
    found: JSON = {
        **provenance.head("benchmarks.temporal"),
        "bundle": load_manifest(given.bundle).name,
        "rows": [],
    }
    with provenance.load_around(found):
        for row in _rows(given):
            found["rows"].append(row)
            print(json.dumps(row), file=sys.stderr)
    write_figures(given.out, found)
    write_page(given.page, page(found))
    return 0


def _rows(given: argparse.Namespace) -> Iterator[JSON]:
    for scene, subject in _subjects(given.scenes, given.only.split(",")):
        for factor in BUDGETS:
            budget = max(1, int(factor * subject.pixels))
            if budget < subject.dump.total:
                yield {"scene": scene, "budget_factor": factor, **measure(subject, budget, given.bundle)}


def measure(subject: Subject, budget: int, bundle: Path) -> JSON:
    """Both techniques on one view.

    Args:
        subject: The view.
        budget: F.
        bundle: Folder of a bundle.

    Returns:
        `still`: frame -> error over that of `kbuffer-deep`; `moving`: degrees -> `error` and `flicker` likewise, the
        latter None where neither reaches `STEADY`, and `k`, the mean change of k from frame to frame of both;
        `milliseconds`: of a frame over that of the other.
    """
    spec = load_manifest(bundle).tail
    given = Budget(budget, spec.name, spec.g)
    plain, learning = (technique(name, Needs(bundle=bundle)) for name in COMPARED)
    first = _shot(subject, plain, given)
    still, times = [], []
    for _ in range(max(SHOWN) + 1):
        other, shot = _shot(subject, plain, given), _shot(subject, learning, given)
        still.append(shot.error)
        times.append(shot.ms / other.ms)
    return {
        "still": {str(frame): over(still[frame], first.error) for frame in SHOWN},
        "moving": {str(step): _moving(subject, given, bundle, step) for step in STEPS},
        "milliseconds": statistics.median(times),
    }


def _moving(subject: Subject, budget: Budget, bundle: Path, step: float) -> JSON:
    path = camera_path(subject.view, MOVING + 1, step)
    views = [Subject(subject.gpu, view, subject.size) for view in path]
    seen = {}
    for name in COMPARED:
        made = technique(name, Needs(bundle=bundle))
        for _ in range(REST - 1):
            _shot(subject, made, budget)
        seen[name] = [_shot(view, made, budget) for view in views]
    error = {name: sum(shot.error for shot in shots[1:]) for name, shots in seen.items()}
    changes = {name: _changes(views, shots) for name, shots in seen.items()}
    plain, learning = COMPARED
    flicker, still = changes[learning][0], changes[plain][0]
    return {
        "error": over(error[learning] / MOVING, error[plain] / MOVING),
        "flicker": None if max(flicker, still) < STEADY else flicker / max(still, STEADY),
        "k": [changes[name][1] for name in COMPARED],
    }


def _changes(views: Sequence[Subject], shots: Sequence[Shot]) -> tuple[float, float]:
    """Flicker, and the mean change of k of pixels that have fragments in both frames; means over frames."""
    colour, k = [], []
    for (before, now), (was, here) in zip(pairwise(shots), pairwise(views), strict=True):
        colour.append(error_change(now.image, before.image, here.exact8, was.exact8))
        both = (was.dump.counts > 0) & (here.dump.counts > 0)
        k.append(k_change(now.k, before.k, both))
    return statistics.fmean(colour), statistics.fmean(k)


def _shot(subject: Subject, made: Technique, budget: Budget) -> Shot:
    rendered, recording = shoot(subject, made, budget, shared_clock(subject.gpu.ctx))
    error = subject.reference.display_error(rendered.linear.reshape(-1, 3))
    return Shot(error, display8(rendered.linear), rendered.k, recording.milliseconds)


def _subjects(scenes: Path, wanted: Sequence[str]) -> Iterator[tuple[str, Subject]]:
    with tempfile.TemporaryDirectory(prefix="diaphane-temporal-") as folder:
        for case in suite.cases_of(scenes, Path(folder)):
            if case.scene in wanted:
                local = LocalScene(case.path, case.path, LoadOptions(alpha=ALPHA, variants=case.variants))
                local.at(None)
                view: View = local.views(None, case.views)[0].view
                yield case.scene, Subject(local.gpu(), view, SIZE)


def page(found: Mapping[str, Any]) -> str:
    """The results as Markdown."""
    lines = [
        "# Learning from the last frame, measured\n",
        "```\npython -m benchmarks.temporal --bundle FOLDER --out benchmarks/results/temporal.json \\\n"
        "    --page benchmarks/TEMPORAL.md\n```\n",
        "`kbuffer-temporal` over `kbuffer-deep`: squared displayed error and flicker (as `diaphane bench` has it) as\n"
        f"factors, below 1 is better, errors with 1e-7 added as in scores; opacity {ALPHA:g}, {SIZE[0]}x{SIZE[1]}.\n"
        f"*At rest*: so many frames after the first. *Moving*: an orbit of so many degrees a frame, after {REST}\n"
        f"frames at rest; means over {MOVING} frames. *k*: mean change of k from frame to frame without and with\n"
        "learning, at .45 degrees. *Time*: of a frame, median of frames in turns. A dash: neither flickers by\n"
        f"{STEADY:g} of the display's range.\n",
        f"Bundle: {found['bundle']}; *{provenance.said(found)}.*\n",
    ]
    heads = [
        *("scene", "F / WH"),
        *(f"at rest, {frame}" for frame in SHOWN),
        *(f"{what}, {step:g}°" for what in ("error", "flicker") for step in STEPS),
        *("k", "time"),
    ]
    return "\n".join([*lines, table(heads, map(_cells, found["rows"]))])


def _cells(row: Mapping[str, Any]) -> list[str]:
    moving = [row["moving"][str(step)] for step in STEPS]
    numbers = [*row["still"].values(), *(each["error"] for each in moving), *(each["flicker"] for each in moving)]
    k = " → ".join(f"{value:.2f}" for value in row["moving"][str(STEPS[1])]["k"])
    cells = [row["scene"], f"{row['budget_factor']:g}", *map(_number, numbers), k]
    return [*cells, f"{row['milliseconds']:.2f}"]


def _number(value: float | None) -> str:
    return "–" if value is None else f"{value:.2f}"


def _parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--bundle", type=Path, required=True, help="Folder of a bundle of the head bin-gains.")
    parser.add_argument("--scenes", type=Path, default=SHARED, help="Folder with MANIFEST.json.")
    parser.add_argument("--only", default=",".join(SCENES), help="Names of scenes, with commas between.")
    add_outputs(parser, required=True)
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
