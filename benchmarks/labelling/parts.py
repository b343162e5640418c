"""The parts of the benchmark: what each is measured on."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, replace
from functools import cache
from itertools import groupby
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from benchmarks.casting.cases import described_cases
from benchmarks.labelling import timing
from benchmarks.labelling.bandwidth import copy_bandwidth
from benchmarks.labelling.child import cost
from benchmarks.labelling.linear import QUICK, WHOLE, exponent, growth
from benchmarks.labelling.scenes import Effort, by_scene, certify_scenes
from benchmarks.labelling.stored import dump_bytes, store
from benchmarks.labelling.views import SIZE
from benchmarks.render.setup import subjects
from renderer.capture import capture
from renderer.context import gl_context
from renderer.frame import Frame
from schemas.fragments import FragmentDump
from schemas.problem import ExitCode, Problem

_QUICK_SIZE = (143, 96)
_QUICK_ROUNDS = 1


@dataclass(frozen=True, slots=True)
class Setting:
    """What was asked for.

    Attributes:
        scenes: Folder with MANIFEST.json.
        views: Most views of a stage that are certified; None: all.
        rows: Where verdicts are kept from run to run; None: nowhere.
        quick: Tiny views.
        rounds: Of what is measured in turns.
    """

    scenes: Path
    views: int | None = None
    rows: Path | None = None
    quick: bool = False
    rounds: int = 9

    @property
    def size(self) -> tuple[int, int]:
        """Pixels per row, rows."""
        return _QUICK_SIZE if self.quick else SIZE


def run(part: str, setting: Setting) -> Any:
    """The figures of a part.

    Args:
        part: One of PARTS.
        setting: What was asked for.
    """
    return _PARTS[part](replace(setting, rounds=_QUICK_ROUNDS) if setting.quick else setting)


def wrong(part: str, found: Any) -> list[str]:
    """What is not as it has to be, whatever the machine."""
    if part == "certified":
        return [f"{name}: {line}" for name, scene in found["scenes"].items() for line in scene["wrong"]]
    if part == "heaps":
        return [f"{row['view']}: {name} differs" for row in found for name, equal in row["equal"].items() if not equal]
    return []


@cache
def _dump(name: str, size: tuple[int, int]) -> FragmentDump | None:
    """First view of a scene of the renderer's benchmark; None where the scene is not there."""
    for subject in subjects(gl_context(), (name,)):
        return capture(Frame(subject.gpu, subject.views[0], *size)).dump
    return None


def _views(setting: Setting, *names: str) -> Iterator[tuple[dict[str, Any], FragmentDump]]:
    """What is said of each view, and its dump; quick runs have the first one only."""
    for name in names[:1] if setting.quick else names:
        dump = _dump(name, setting.size)
        if dump is not None:
            print(f"  {name}, {dump.total:,} fragments", file=sys.stderr, flush=True)
            about = {"view": name, "fragments": dump.total, "pixels": dump.pixels, "dump_bytes": dump_bytes(dump)}
            yield about, dump


def _speed(setting: Setting) -> dict[str, Any]:
    rows = []
    for about, dump in _views(setting, "thicket", "sponza"):
        with TemporaryDirectory(prefix="diaphane-labeller-") as folder:
            stored = store(dump, Path(folder) / "view")
            memory = cost([stored], "optimal", 2, banded=False).peak_bytes
        rows.append({**about, **timing.steps(dump, setting.rounds), "peak_bytes": memory})
    return {"copy_bytes_per_s": copy_bandwidth(1 << 16 if setting.quick else 1 << 25), "views": rows}


def _heaps(setting: Setting) -> list[dict[str, Any]]:
    return [{**about, **timing.heaps(dump, setting.rounds)} for about, dump in _views(setting, "thicket")]


def _linear(setting: Setting) -> dict[str, Any]:
    (subject,) = subjects(gl_context(), ("thicket",))
    extent = QUICK if setting.quick else WHOLE
    costs = []
    for found in growth(subject.gpu, subject.views[0], setting.size, extent, min(setting.rounds, 5)):
        bands = f" in {found.bands} bands" if found.banded else ""
        print(f"  {found.rule}, {found.fragments:,}{bands}: {found.median:.3f} s", file=sys.stderr, flush=True)
        costs.append(found)
    kinds = sorted(costs, key=lambda c: (c.rule, c.banded))
    return {
        "costs": [asdict(found) for found in costs],
        "exponents": [
            {"rule": rule, "banded": banded, "exponent": exponent(group), "from": min(c.fragments for c in group)}
            for (rule, banded), found in groupby(kinds, key=lambda c: (c.rule, c.banded))
            for group in [list(found)]
        ],
    }


def _several_g(setting: Setting) -> list[dict[str, Any]]:
    return [
        {**about, "times": timing.several_g(dump, setting.rounds)}
        for about, dump in _views(setting, "thicket", "sponza")
    ]


def _metrics(setting: Setting) -> list[dict[str, Any]]:
    return [{**about, "times": timing.every_metric(dump, setting.rounds)} for about, dump in _views(setting, "thicket")]


def _certified(setting: Setting) -> dict[str, Any]:
    if not (setting.scenes / "MANIFEST.json").exists():
        raise Problem(f"There is no {setting.scenes / 'MANIFEST.json'}.", "Give --scenes FOLDER.", ExitCode.NOT_FOUND)
    effort = Effort(setting.size, 1 if setting.quick else setting.views, setting.rows)
    return {
        "size": setting.size,
        "most_views": effort.views,
        **by_scene(certify_scenes(described_cases(setting.scenes), effort)),
    }


_PARTS: dict[str, Callable[[Setting], Any]] = {
    "speed": _speed,
    "heaps": _heaps,
    "linear": _linear,
    "g": _several_g,
    "metrics": _metrics,
    "certified": _certified,
}
PARTS = tuple(_PARTS)
