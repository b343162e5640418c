"""Every scene against an independent reading of its stage and independent rays through its pixels.

python -m benchmarks.raycast SCENES --out benchmarks/results/raycast.json --page benchmarks/RAYCAST.md
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from datetime import UTC, datetime
from pathlib import Path

from benchmarks.casting.cases import Case, described_cases, sample_cases
from benchmarks.casting.check import Effort, Result, check
from benchmarks.casting.page import figures, page
from renderer.context import describe, gl_context
from services.versions import library_versions, machine


def main() -> int:
    """Checks what was asked for; 1 if anything is unexplained."""
    arguments = _parse()
    effort = Effort((arguments.size[0], arguments.size[1]), arguments.views, arguments.pixels)
    with tempfile.TemporaryDirectory(prefix="diaphane-raycast-") as folder:
        cases = [*described_cases(arguments.scenes), *sample_cases(Path(folder))]
        wanted = set(arguments.only.split(",")) if arguments.only else {case.scene for case in cases}
        results = [_check(case, effort) for case in cases if case.scene in wanted]
    found = {
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
        "command": "python -m benchmarks.raycast " + " ".join(sys.argv[1:]),
        "machine": machine(),
        "driver": describe(gl_context()),
        "versions": library_versions(),
        "scenes": figures(results),
    }
    if arguments.out is not None:
        arguments.out.parent.mkdir(parents=True, exist_ok=True)
        arguments.out.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
    if arguments.page is not None:
        arguments.page.write_text(page(found, effort), encoding="utf-8")
    problems = sum(len(result.problems) for result in results)
    print(f"{problems} unexplained in {len(results)} stages")
    return 1 if problems else 0


def _parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("scenes", type=Path, help="folder with MANIFEST.json")
    parser.add_argument("--out", type=Path, metavar="FILE", help="JSON file that the figures go to")
    parser.add_argument("--page", type=Path, metavar="FILE", help="Markdown file that the tables go to")
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
