"""The loader judged by OpenUSD's Storm: silhouettes, depths, opacities and colours of every scene.

`--only` judges some scenes anew, and keeps what the figures have of the others.

python -m benchmarks.storm_judge SCENES --out benchmarks/results/loader.json --page benchmarks/LOADER.md
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from pathlib import Path
from typing import Any

from benchmarks import provenance
from benchmarks.casting.cases import Case, described_cases, sample_cases
from benchmarks.judging.judge import Verdict, judge
from benchmarks.judging.page import figures, page
from benchmarks.outputs import add_outputs, write_figures, write_page
from evaluation.storm.engine import Engine
from renderer.context import describe, gl_context


def main() -> None:
    """Judges what was asked for."""
    arguments = _parse()
    engine = Engine.of(arguments.python)
    found: dict[str, Any] = {**provenance.head("benchmarks.storm_judge"), "driver": describe(gl_context())}
    with provenance.load_around(found), tempfile.TemporaryDirectory(prefix="diaphane-judge-") as folder:
        cases = [*described_cases(arguments.scenes), *sample_cases(Path(folder))]
        wanted = set(arguments.only.split(",")) if arguments.only else {case.scene for case in cases}
        verdicts = [_judge(engine, case, arguments.sheets) for case in cases if case.scene in wanted]
    found["storm"] = next((verdict.version for verdict in verdicts if verdict.version), "")
    found["scenes"] = {**_kept(arguments), **figures(verdicts)}
    write_figures(arguments.out, found)
    write_page(arguments.page, page(found))


def _parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("scenes", type=Path, help="folder with MANIFEST.json")
    add_outputs(parser)
    parser.add_argument("--python", type=Path, default=Path(".venv-peers/bin/python"), help="interpreter with Storm")
    parser.add_argument("--only", help="names of scenes, with commas")
    parser.add_argument("--sheets", type=Path, metavar="FOLDER", help="gets a picture of every difference")
    return parser.parse_args()


def _kept(arguments: argparse.Namespace) -> dict[str, Any]:
    """Scenes that are not judged anew."""
    if not arguments.only or arguments.out is None or not arguments.out.is_file():
        return {}
    return dict(json.loads(arguments.out.read_text(encoding="utf-8"))["scenes"])


def _judge(engine: Engine, case: Case, sheets: Path | None) -> Verdict:
    start = time.perf_counter()
    verdict = judge(gl_context(), engine, case, sheets)
    wrong = {kind: count.unexplained for kind, count in verdict.counts.items() if count.unexplained}
    said = verdict.refused or ", ".join(f"{kind} {pixels}" for kind, pixels in wrong.items()) or "agrees"
    print(f"{case.scene} {case.path.name}: {time.perf_counter() - start:.1f} s, {said}", flush=True)
    return verdict


if __name__ == "__main__":
    main()
