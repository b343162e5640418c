"""A graphics card measured unattended, within minutes, into one file for `benchmarks/results`.

python -m benchmarks.gpu

Scenes of the project's own, deep ones among them, and the shared ones where their folder is there; every technique at
1920x1080, the bounded ones within three budgets; medians of frames in turns, by the GPU's timers where they are right.
Before that, every technique is drawn small and compared with its float64 twin, so that a driver's mistakes are seen.
The most telling parts come first, and what the time does not hold is named. The file says what the card, its driver,
processor and system are, and nothing else of the machine.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import moderngl

from benchmarks import provenance
from benchmarks.casting.cases import SHARED
from benchmarks.comparing.measured import RESULTS
from benchmarks.comparing.scenes import BUNDLE
from benchmarks.graphics.checking import TOLERANCE, Check, checked, why
from benchmarks.graphics.measuring import Measuring, said
from benchmarks.graphics.plan import BUDGETS, PLAN, SIZE, Planned, planned
from benchmarks.outputs import write_figures
from benchmarks.suite import label
from evaluation.bench.cells import bundle_of
from evaluation.bench.groups import said_alpha
from evaluation.bench.options import parse_budgets, parse_sizes
from evaluation.bench.subject import Subject
from evaluation.stress.gl_drivers import GPU
from renderer.context import describe, gl_context
from renderer.techniques import Needs
from renderer.timing import timers_are_right
from schemas.bench import BenchCell
from schemas.problem import ExitCode, Problem
from schemas.work import Device

MODULE = "benchmarks.gpu"
MINUTES = 9.0
"""With the last scene's end it is ten."""
CHECK_SIZE = (320, 180)
JSON = dict[str, Any]


def main(arguments: Sequence[str] | None = None) -> int:
    """Measures, and says where the file is and where it belongs."""
    given = _parse(arguments)
    try:
        driver = usable_driver(given.software)
    except Problem as problem:
        print(f"error: {problem.title}\n{problem.remedy}", file=sys.stderr)
        return int(problem.code)
    deadline = time.monotonic() + 60.0 * given.minutes
    out: Path = given.out or RESULTS / f"gpu-{label()}.json"
    bundle = bundle_of(given.bundle)
    found: JSON = {
        **provenance.head(MODULE, arguments),
        "driver": driver,
        "is_graphics_card": GPU.is_it(driver),
        "timers": "GPU timer queries" if timers_are_right(gl_context()) else "host clock, each pass finished",
        "bundle": bundle.label,
        "device": Device().model_dump(),
        "scenes": [],
        "left_out": [],
    }
    _tell(f"{driver}: {found['timers']}; {given.minutes:g} minutes at most")
    with provenance.load_around(found), tempfile.TemporaryDirectory(prefix="diaphane-gpu-") as folder:
        needs = Needs(bundle=bundle.folder)
        for row in _rows(given, Path(folder), deadline, needs, found["left_out"]):
            found["scenes"].append(row)
            write_figures(out, found)
    write_figures(out, found)
    return _conclude(found, out)


def usable_driver(allow_software: bool) -> str:
    """The driver in words.

    Args:
        allow_software: Whether a software rasteriser will do.

    Raises:
        Problem: It is one, and will not.
    """
    driver = describe(gl_context())
    if not GPU.is_it(driver) and not allow_software:
        raise Problem(
            f"OpenGL runs on {driver}, a software rasteriser: its times say nothing about a graphics card.",
            "Install the card's own driver with EGL (NVIDIA: libnvidia-gl; AMD and Intel: libegl-mesa0 and "
            "libgl1-mesa-dri, and access to /dev/dri, which the groups video and render have). With several devices, "
            "GLCONTEXT_DEVICE_INDEX=1 chooses another one. `.venv/bin/python -m renderer.context` says which is used. "
            'ARGS="--software" measures anyway.',
            ExitCode.CHECK_FAILED,
        )
    return driver


def _rows(
    given: argparse.Namespace, folder: Path, deadline: float, needs: Needs, left_out: list[str]
) -> Iterator[JSON]:
    wanted = given.only.split(",") if given.only else None
    seen = set()
    for each in planned(given.scenes, folder, wanted):
        seen.add((each.case.scene, each.alpha))
        where = f"{each.case.scene}, {said_alpha(each.alpha)}"
        if time.monotonic() > deadline:
            left_out.append(f"{where}: no time was left.")
            continue
        try:
            row, late = measured(each, given, deadline, needs)
        except moderngl.Error as reason:
            left_out.append(f"{where}: {why(reason)}")
            continue
        if late:
            left_out.append(f"{where}: without {', '.join(late)}.")
        _tell(said_row(row))
        yield row
    for name, alpha in PLAN:
        if (name, alpha) not in seen and (wanted is None or name in wanted):
            left_out.append(f"{name}, {said_alpha(alpha)}: there is no such scene in {given.scenes.name}.")


def measured(each: Planned, given: argparse.Namespace, deadline: float, needs: Needs) -> tuple[JSON, list[str]]:
    """A scene's row, and what there was no time for."""
    start = time.monotonic()
    local, tail = each.loaded(), bundle_of(given.bundle).tail.name
    view = local.views(None, each.case.views)[0].view
    names = [name for name in each.techniques() if given.techniques is None or name in given.techniques.split(",")]
    checks = list(checked(local, view, CHECK_SIZE, names, needs, tail))
    subject = Subject(local.gpu(), view, given.size)
    measuring = Measuring(subject, needs, tail, given.budgets, given.repeats, deadline)
    cells = measuring.cells(names, counts_work=given.account)
    n = measuring.n
    row = {
        **{"scene": each.case.scene, "alpha": each.alpha, "width": given.size[0], "height": given.size[1]},
        **{"triangles": len(local.now.scene.indices) // 3, "fragments": int(n.sum(dtype="int64"))},
        **{"occupied": int((n > 0).sum()), "most": int(n.max(initial=0))},
        "checks": [{**asdict(check), "is_right": check.is_right} for check in checks],
        "cells": [cell.model_dump(mode="json", exclude_defaults=True) for cell in cells],
        "seconds": round(time.monotonic() - start, 1),
    }
    return row, measuring.late


def said_row(row: Mapping[str, Any]) -> str:
    """A scene's result on a few lines."""
    depth = row["fragments"] / (row["width"] * row["height"])
    lines = [f"{row['scene']}, {said_alpha(row['alpha'])}: N = {depth:.1f} WH, {row['seconds']:.0f} s"]
    for cell in map(BenchCell.model_validate, row["cells"]):
        bound = f", bound {Device().bound(cell.work.values()):.2f} ms" if cell.work else ""
        lines.append(f"  {said(cell.key):<34} {_milliseconds(cell)}{bound}")
    wrong = [Check(**{k: v for k, v in check.items() if k != "is_right"}) for check in row["checks"]]
    lines += [f"  WRONG: {said_check(check)}" for check in wrong if not check.is_right]
    return "\n".join(lines)


def said_check(check: Check) -> str:
    """What is wrong with a picture."""
    if check.problem is not None:
        return f"{check.technique}: {check.problem}"
    return (
        f"{check.technique}: {check.off} of {check.compared} pixels differ from the float64 twin by more than "
        f"{TOLERANCE:g}, by up to {check.largest:.2g}"
    )


def _milliseconds(cell: BenchCell) -> str:
    if cell.problem is not None:
        return cell.problem
    if cell.gpu:
        return f"{sum(cell.gpu.values()):.2f} ms on the GPU"
    return "not timed" if cell.frame is None else f"{cell.frame.median:.2f} ms"


def _conclude(found: Mapping[str, Any], out: Path) -> int:
    for line in found["left_out"]:
        _tell(f"left out: {line}")
    if not found["scenes"]:
        print("error: Nothing was measured.\nGive more --minutes, or scenes that there are.", file=sys.stderr)
        return int(ExitCode.NOT_FOUND)
    print(out)
    if found["is_graphics_card"]:
        print("Open a pull request that adds this file to benchmarks/results, or attach it to an issue.")
    if all(check["is_right"] for row in found["scenes"] for check in row["checks"]):
        return 0
    print("Pictures are wrong on this driver (see WRONG above): please send the file all the same.", file=sys.stderr)
    return int(ExitCode.CHECK_FAILED)


def _tell(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


def _parse(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, metavar="FILE", help="default: benchmarks/results/gpu-DRIVER.json")
    parser.add_argument("--minutes", type=float, default=MINUTES, help="after which no cell is begun")
    parser.add_argument("--software", action="store_true", help="also on a software rasteriser")
    parser.add_argument("--scenes", type=Path, default=SHARED, help="with MANIFEST.json; may be missing")
    parser.add_argument("--only", help="scenes, with commas")
    parser.add_argument("--techniques", help="names, with commas")
    parser.add_argument("--budgets", type=parse_budgets, default=BUDGETS, help="F / WH, with commas")
    parser.add_argument("--size", type=lambda text: parse_sizes(text)[0], default=SIZE, help="WIDTHxHEIGHT")
    parser.add_argument("--repeats", type=int, default=15, help="timed frames of each cell")
    parser.add_argument("--no-account", dest="account", action="store_false", help="count no work of frames")
    parser.add_argument("--bundle", type=Path, default=BUNDLE, help="folder of another bundle")
    return parser.parse_args(arguments)


if __name__ == "__main__":
    sys.exit(main())
