"""Every scene against an independent reading of its stage and independent rays through its pixels.

python -m benchmarks.raycast SCENES --out benchmarks/results/raycast.json --page benchmarks/RAYCAST.md
"""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path
from typing import Any

from benchmarks import provenance
from benchmarks.casting.cases import Case, described_cases, sample_cases
from benchmarks.casting.check import Effort, Result, check
from benchmarks.casting.page import figures, page
from benchmarks.outputs import add_outputs, write_figures, write_page
from renderer.context import describe, gl_context


def main() -> int:
    """Checks what was asked for; 1 if anything is unexplained."""
    arguments = _parse()
    effort = Effort((arguments.size[0], arguments.size[1]), arguments.views, arguments.pixels)
    found: dict[str, Any] = {**provenance.head("benchmarks.raycast"), "driver": describe(gl_context())}
    with provenance.load_around(found), tempfile.TemporaryDirectory(prefix="diaphane-raycast-") as folder:
        cases = [*described_cases(arguments.scenes), *sample_cases(Path(folder))]
        wanted = set(arguments.only.split(",")) if arguments.only else {case.scene for case in cases}
        results = [_check(case, effort) for case in cases if case.scene in wanted]
    found["scenes"] = figures(results)
    write_figures(arguments.out, found)
    write_page(arguments.page, page(found, effort))
    problems = sum(len(result.problems) for result in results)
    print(f"{problems} unexplained in {len(results)} stages")
    return 1 if problems else 0


def _parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("scenes", type=Path, help="folder with MANIFEST.json")
    add_outputs(parser)
    parser.add_argument("--only", help="names of scenes, with commas")
    parser.add_argument("--size", type=int, nargs=2, default=(640, 430), metavar=("WIDTH", "HEIGHT"))
    parser.add_argument("--views", type=int, default=2, help="of each stage")
    parser.add_argument("--pixels", type=int, default=1000, help="rays through each view")
    return parser.parse_args()


def _check(case: Case, effort: Effort) -> Result:
    start = time.perf_counter()
    result = check(gl_context(), case, effort)
    said = "; ".join(result.problems) or result.refused or "agrees"
    print(f"{case.scene} {case.path.name}: {time.perf_counter() - start:.1f} s, {said}", flush=True)
    return result


if __name__ == "__main__":
    raise SystemExit(main())
