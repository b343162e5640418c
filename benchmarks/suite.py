"""The committed benchmark: techniques that a still frame shows, on the papers' scenes and our own, and a page of it.

python -m benchmarks.suite

It can be stopped at any time and goes on where it was: what was measured lies in `--work`, which begins with the
committed results of this machine and driver; `--fresh` measures all anew. `--quick` measures two scenes at 320x214 and
writes nothing beside `--work`. No technique is timed for longer than `--limit` seconds a cell beside its warm-up: one
that takes longer for a single frame, such as depth peeling on a software driver, is timed once, by that frame.
"""

from __future__ import annotations

import argparse
import re
import sys
import tempfile
import time
from collections.abc import Iterable
from pathlib import Path

from benchmarks.casting.cases import SHARED as FOLDER
from benchmarks.comparing.measured import RESULTS, read_lines
from benchmarks.comparing.page import USUAL, page, pictures
from benchmarks.comparing.scenes import (
    ALPHAS,
    BUNDLE,
    GROUPS,
    PARTS,
    SHARED,
    SIZES,
    Part,
    cases_of,
    parts_of,
    selected,
)
from evaluation.bench.cells import bundle_of
from evaluation.bench.files import write_files
from evaluation.bench.groups import said_alpha
from evaluation.bench.kept import ROWS, Kept
from evaluation.bench.options import BenchOptions, parse_alphas, parse_sizes
from evaluation.bench.run import bench, result_of
from evaluation.progress import Progress, make_progress
from evaluation.versions import machine
from evaluation.writing import replacing
from renderer.context import describe, gl_context
from renderer.techniques import TECHNIQUES as technique_entries
from schemas.bench import BenchResult, BenchView

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "benchmarks" / "BENCH.md"
COMMAND = "make bench"
TECHNIQUES = tuple(name for name, entry in technique_entries.items() if entry.settles == 1)
"""Those that a still frame shows. `kbuffer-temporal` learns from frames: it is measured by `benchmarks.temporal`."""
BUDGETS = (0.125, 0.25, 0.5, 1.0, 2.0, 4.0)
"""F / WH, the papers' and down to what authored scenes hold: the same for all, since the page has means over them."""
_QUICK = {"sizes": ((320, 214),), "alphas": (0.33,), "scenes": ("sponza", "bottles")}


def main() -> int:
    """Measures what is missing, then writes results, figures and the page."""
    arguments = _parse()
    if arguments.page_only:
        text, drawn = published()
        PAGE.write_text(text, encoding="utf-8")
        for file, svg in drawn.items():
            (PAGE.parent / file).write_text(svg, encoding="utf-8")
        print(PAGE)
        return 0
    progress = make_progress(sys.stderr)
    work = arguments.work / ("quick" if arguments.quick else label())
    _begin(work, arguments.fresh, with_committed=not arguments.quick)
    left_out: list[str] = []
    with tempfile.TemporaryDirectory(prefix="diaphane-suite-") as folder:
        only = selected(arguments.only.split(",")) if arguments.only else None
        cases = cases_of(arguments.scenes, Path(folder), only)
        if absent := {*SHARED} & (only or {*SHARED}) - {case.scene for case in cases}:
            progress.note(f"{', '.join(sorted(absent))}: not in {arguments.scenes}, left out")
        parts = list(parts_of(cases, arguments.alphas, arguments.sizes))
        for number, part in enumerate(parts):
            start = time.perf_counter()
            left_out += bench(_options(part, arguments, work), arguments.bundle, COMMAND, progress).left_out
            _tell(progress, part, number, len(parts), time.perf_counter() - start)
    bundle = bundle_of(arguments.bundle).label
    result = result_of(Kept(work, resume=True), COMMAND, bundle, [plain_path(line) for line in left_out])
    if len(result.views) < PARTS * arguments.views and not arguments.quick:
        said = f"The suite has {PARTS} parts, less those that are opaque as authored; {len(result.views)} are measured."
        result = result.model_copy(update={"left_out": (*result.left_out, said)})
    if not result.views:
        print("Nothing was measured.", file=sys.stderr)
        return 1
    write_files(work, result)
    if arguments.quick:
        print(page({"quick": result}, {}))
        return 0
    _publish(result)
    print(PAGE)
    return 0


def _begin(work: Path, fresh: bool, with_committed: bool) -> None:
    """What is kept of earlier runs; a first run begins with what is committed of this machine and driver.

    A run that goes on takes nothing from there: had it begun with `--fresh`, old measurements would pass for new ones.
    """
    if fresh:
        (work / ROWS).unlink(missing_ok=True)
    committed = RESULTS / f"bench-{label()}.jsonl"
    if fresh or not with_committed or not committed.exists() or Kept(work, resume=True).views:
        return
    here = (describe(gl_context()), machine())
    views = [view for view in read_lines(committed).views if (view.driver, view.machine) == here]
    with replacing(work / ROWS) as path:
        path.write_text(_lines(views), encoding="utf-8")


def label() -> str:
    """Short name of the driver, for files: what the renderer is called before any bracket, slash or comma."""
    name = re.split(r"[(/,]", describe(gl_context()).lower())[0]
    return "-".join(re.findall(r"[a-z0-9]+", name))


def _publish(result: BenchResult) -> None:
    """The committed files of this driver, and the page of those of all drivers."""
    name = label()
    head = result.model_copy(update={"views": ()}).model_dump_json(exclude_defaults=True)
    RESULTS.mkdir(exist_ok=True)
    (RESULTS / f"bench-{name}.jsonl").write_text(f"{head}\n{_lines(result.views)}", encoding="utf-8")
    text, drawn = published()
    for file, svg in drawn.items():
        (PAGE.parent / file).write_text(svg, encoding="utf-8")
    PAGE.write_text(text, encoding="utf-8")


def published() -> tuple[str, dict[str, str]]:
    """The page of all committed results, and its figures: file, relative to the page, -> text."""
    found = {path.stem.removeprefix("bench-"): read_lines(path) for path in sorted(RESULTS.glob("bench-*.jsonl"))}
    drawn = {(of, figure): svg for of, each in found.items() for figure, svg in pictures(each).items()}
    files = {(of, figure): f"{RESULTS.name}/bench-{of}-{figure}.svg" for of, figure in drawn}
    return page(found, files), {files[key]: svg for key, svg in drawn.items()}


def _lines(views: Iterable[BenchView]) -> str:
    return "".join(view.model_dump_json(exclude_defaults=True) + "\n" for view in views)


def plain_path(line: str) -> str:
    """A sentence without the folder that its scene lies in."""
    return re.sub(r"\S*/", "", line)


def _options(part: Part, arguments: argparse.Namespace, work: Path) -> BenchOptions:
    return BenchOptions(
        scenes=(part.case.path,),
        techniques=tuple(name for name in TECHNIQUES if part.measures(name)),
        out=work,
        budgets=BUDGETS,
        alphas=(part.alpha,),
        sizes=(part.size,),
        bundle=str(arguments.bundle),
        views=part.case.views,
        most_views=arguments.views,
        variants=part.case.variants,
        path=part.path,
        account=part.size == SIZES[0],
        closer=USUAL,
        repeats=arguments.repeats,
        limit=arguments.limit,
    )


def _tell(progress: Progress, part: Part, number: int, total: int, seconds: float) -> None:
    what = f"{part.case.scene}, {said_alpha(part.alpha)}, {part.size}"
    progress.note(f"part {number + 1} of {total}: {what}: {seconds:.0f} s")


def _parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", type=Path, default=FOLDER, help="with MANIFEST.json")
    parser.add_argument("--only", help=f"scenes or groups ({', '.join(GROUPS)}), with commas")
    parser.add_argument("--alpha", dest="alphas", type=parse_alphas, default=ALPHAS, help="as of diaphane bench")
    parser.add_argument("--size", dest="sizes", type=parse_sizes, default=SIZES, help="as of diaphane bench")
    parser.add_argument("--views", type=int, default=1, help="of each scene")
    parser.add_argument("--bundle", type=Path, default=BUNDLE, help="folder of another bundle")
    parser.add_argument("--repeats", type=int, default=2)
    parser.add_argument("--limit", type=float, default=12.0, help="seconds for the repeats of one cell")
    parser.add_argument("--work", type=Path, default=ROOT / ".diaphane" / "bench", help="results under way")
    parser.add_argument("--quick", action="store_true", help="two scenes at 320x214, nothing is published")
    parser.add_argument("--fresh", action="store_true", help="nothing that was measured before is kept")
    parser.add_argument(
        "--page-only", action="store_true", help="measure nothing: write the page of the committed results again"
    )
    arguments = parser.parse_args()
    if arguments.quick:
        arguments.sizes, arguments.alphas = _QUICK["sizes"], _QUICK["alphas"]
        arguments.only = arguments.only or ",".join(map(str, _QUICK["scenes"]))
        arguments.repeats = 1
    return arguments


if __name__ == "__main__":
    sys.exit(main())
