"""Certificates of all views of all scenes, added up by scene; what was done before a stop is not done again."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from benchmarks.casting.cases import Case
from benchmarks.labelling.certified import certify
from benchmarks.labelling.views import CapturedView, captured_views
from evaluation.versions import code_version

_MADE_BY = ("labeller", "renderer", "benchmarks.labelling.certified", "benchmarks.labelling.views")


@dataclass(frozen=True, slots=True)
class Effort:
    """How much is certified.

    Attributes:
        size: Pixels per row, rows.
        views: Most views of a stage; None: all that are listed.
        rows: Where verdicts are kept from run to run, JSON lines; None: nowhere.
    """

    size: tuple[int, int]
    views: int | None
    rows: Path | None = None


def certify_scenes(cases: Sequence[Case], effort: Effort) -> list[dict[str, Any]]:
    """Verdicts of every view: one line a view, in the order of the cases."""
    version = code_version(*_MADE_BY)
    kept = _kept(effort, version)
    lines = list(kept.values())
    for case in cases:
        for view in captured_views(case, effort.size, effort.views, frozenset(kept)):
            lines.append(_certified(view))
            if effort.rows is not None:
                with effort.rows.open("a", encoding="utf-8") as file:
                    file.write(json.dumps({**lines[-1], "version": version, "size": effort.size}) + "\n")
    order = {case.scene: number for number, case in enumerate(cases)}
    return sorted((line for line in lines if line["scene"] in order), key=lambda line: order[line["scene"]])


def _certified(view: CapturedView) -> dict[str, Any]:
    line: dict[str, Any] = {"scene": view.scene, "stage": view.stage, "mode": view.mode, "view": view.view}
    start = time.perf_counter()
    verdicts = [] if view.dump is None else [asdict(verdict) for verdict in certify(view.dump)]
    line |= {"fragments": 0 if view.dump is None else view.dump.total, "why": view.why, "verdicts": verdicts}
    gap = max((verdict["gap"] for verdict in verdicts), default=0.0)
    wrong = [text for verdict in verdicts for text in verdict["wrong"]]
    said = view.why or f"{line['fragments']:,} fragments, gap {gap:.1e}, {time.perf_counter() - start:.1f} s"
    print(*(word for word in view.key if word), said, *wrong, sep=", ", file=sys.stderr, flush=True)
    return line


def _kept(effort: Effort, version: str) -> dict[tuple[str, str, str, str], dict[str, Any]]:
    """Lines of an earlier run of the same code at the same size."""
    if effort.rows is None or not effort.rows.exists():
        return {}
    lines = [json.loads(line) for line in effort.rows.read_text(encoding="utf-8").splitlines()]
    return {
        (line["scene"], line["stage"], line["mode"], line["view"]): line
        for line in lines
        if line["version"] == version and line["size"] == list(effort.size) and line["view"]
    }


def by_scene(lines: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """What JSON holds of the lines: a summary of each scene, and the largest gaps of all."""
    scenes: dict[str, list[dict[str, Any]]] = {}
    for line in lines:
        scenes.setdefault(line["scene"], []).append(line)
    hardest = sorted(_cases(lines), key=lambda verdict: -verdict["gap"])[:10]
    return {"scenes": {name: _summary(found) for name, found in scenes.items()}, "hardest": hardest}


def _cases(lines: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    names = ("scene", "stage", "mode", "view")
    return [{**{n: line[n] for n in names}, **verdict} for line in lines for verdict in line["verdicts"]]


def _summary(lines: list[dict[str, Any]]) -> dict[str, Any]:
    cases = _cases(lines)
    decided = [case for case in cases if not case["exact"]]
    return {
        "views": sum(bool(line["view"]) for line in lines),
        "stages": len({line["stage"] for line in lines}),
        "stages without a view": len(
            {line["stage"] for line in lines if not line["view"] and line["mode"] != "authored"}
        ),
        "most fragments": max(line["fragments"] for line in lines),
        "cases": len(cases),
        "decided": len(decided),
        "proven": sum(case["proven"] for case in decided),
        "gap": max((case["gap"] for case in decided), default=0.0),
        "greedy": max((case["greedy"] for case in decided if case["greedy"]), default=None),
        "increment": max((case["increment"] for case in decided if case["increment"]), default=None),
        "wrong": [
            f"{case['stage']}, {case['mode']}, {case['view']}, F = {case['name']}: {text}"
            for case in cases
            for text in case["wrong"]
        ],
    }
