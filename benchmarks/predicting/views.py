"""The views that predictors are trained and scored on: captured once, their fragments kept."""

from __future__ import annotations

import hashlib
import re
import sys
from collections import Counter
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Final

import numpy as np

from benchmarks.casting.cases import Case, described_cases, sample_cases
from benchmarks.labelling.views import captured_views
from benchmarks.predicting.store import Store, key_of
from schemas.fragments import FragmentDump
from schemas.problem import Problem

MULTIPLES: Final = (1, 2, 4)
"""Budgets that are scored: F = W H times this, where F < N."""

STAGES: Final = 3
"""Most stages of a scene: some have many small ones, and every asset weighs the same anyway."""

_ARRAYS: Final = ("offsets", "rgba", "depth", "background", "facing")


@dataclass(frozen=True, slots=True)
class ViewRow:
    """A view of an asset.

    Attributes:
        name: Of its files.
        asset: The scene that it shows; held out as a whole.
        stage: File of the stage.
        mode: Opacity: one for all surfaces, or each its own.
        view: The camera's name.
        pixels: W H.
        fragments: N, above W H.
        occupied: Pixels with at least one fragment.
        digest: Of its fragments.
    """

    name: str
    asset: str
    stage: str
    mode: str
    view: str
    pixels: int
    fragments: int
    occupied: int
    digest: str

    @property
    def multiples(self) -> list[int]:
        """Of W H, the budgets below N."""
        return [m for m in MULTIPLES if m * self.pixels < self.fragments]

    @property
    def budgets(self) -> list[int]:
        """F of each."""
        return [m * self.pixels for m in self.multiples]


def views_of(store: Store, scenes: Path | None, size: tuple[int, int], most: int) -> list[ViewRow]:
    """Every view with more fragments than pixels. What was captured before is not captured again.

    Stages are told apart by name, size and views alone: after a change of the renderer delete the folder `dumps`.

    Args:
        store: Where they are kept.
        scenes: Folder with MANIFEST.json; None: the project's own scenes only.
        size: Pixels per row, rows.
        most: Views of a stage, in each mode.
    """
    seen: Counter[str] = Counter()
    rows: list[ViewRow] = []
    for case in sample_cases(store.folder / "samples") + (described_cases(scenes) if scenes is not None else []):
        seen[case.scene] += 1
        if seen[case.scene] <= STAGES:
            key = key_of(case.scene, case.path.name, case.variants, size, most)
            found = store.remember("dumps", key, partial(_captured, store, case, key, size, most))
            rows += [ViewRow(**row) for row in found]
    return rows


def load_dump(store: Store, row: ViewRow) -> FragmentDump:
    """The fragments of a view."""
    with np.load(store.path("dumps", f"{row.name}.npz")) as file:
        arrays = [file[name] for name in _ARRAYS]
        width, height = (int(x) for x in file["size"])
    return FragmentDump(width, height, *arrays)


def digest_of(dump: FragmentDump) -> str:
    """Hex sha256 of a dump's arrays."""
    hasher = hashlib.sha256(f"{dump.width} {dump.height}".encode())
    for name in _ARRAYS:
        hasher.update(np.ascontiguousarray(getattr(dump, name)).tobytes())
    return hasher.hexdigest()


def _captured(store: Store, case: Case, key: str, size: tuple[int, int], most: int) -> list[dict[str, object]]:
    print(f"capturing {case.scene} {case.path.name}", file=sys.stderr, flush=True)
    return [asdict(row) for row in _rows(store, case, key, size, most)]


def _rows(store: Store, case: Case, key: str, size: tuple[int, int], most: int) -> Iterator[ViewRow]:
    try:
        for view in captured_views(case, size, most):
            dump = view.dump
            if dump is None or dump.total <= dump.pixels:
                continue
            name = re.sub(r"[^\w.-]+", "", f"{case.scene}-{case.path.stem}-{view.mode}-{view.view}-{key[:6]}")
            arrays = {array: getattr(dump, array) for array in _ARRAYS}
            shape = np.array([dump.width, dump.height])
            store.write(store.path("dumps", f"{name}.npz"), partial(np.savez, size=shape, **arrays))
            occupied = int(np.count_nonzero(dump.counts))
            about = (case.scene, case.path.name, view.mode, view.view)
            yield ViewRow(name, *about, dump.pixels, dump.total, occupied, digest_of(dump))
    except Problem as problem:
        print(f"{case.scene} {case.path.name}: {problem.title}", file=sys.stderr, flush=True)
