"""The views that predictors are trained and scored on: captured once, their fragments kept."""

from __future__ import annotations

import hashlib
import re
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Final

import numpy as np

from benchmarks.casting.cases import Case, described_cases, sample_cases
from benchmarks.labelling.views import CapturedView, captured_views, views_of_scene
from benchmarks.predicting.store import Store, key_of
from renderer.opacities import BASE_ALPHA, drawn_opacities
from renderer.scene import LoadOptions, load_scene
from schemas.fragments import FragmentDump
from schemas.problem import Problem

MULTIPLES: Final = (0.125, 0.25, 0.5, 1.0, 2.0, 4.0)
"""Budgets that are scored: F = W H times this, where F < `MOST_SHARE` N."""
MOST_SHARE: Final = 0.95
"""Beyond so much of N next to nothing is left to decide."""

MATERIALS: Final = "materials"
"""Mode of the views that are trained on and never scored: every material has an opacity drawn at random."""

STAGES: Final = 3
"""Most stages of a scene: some have many small ones, and every asset weighs the same anyway."""

_ARRAYS: Final = ("offsets", "rgba", "depth", "background", "facing", "tile_range")


@dataclass(frozen=True, slots=True)
class ViewRow:
    """A view of an asset.

    Attributes:
        name: Of its files.
        asset: The scene that it shows; held out as a whole.
        stage: File of the stage.
        mode: Opacity: one for all surfaces, each its own, or `MATERIALS`.
        view: The camera's name.
        pixels: W H.
        fragments: N, enough for one of the budgets.
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
    def is_scored(self) -> bool:
        """Whether it is scored, and not trained on alone."""
        return self.mode != MATERIALS

    @property
    def multiples(self) -> list[float]:
        """Of W H, the budgets that leave something to decide."""
        return multiples_of(self.pixels, self.fragments)

    @property
    def budgets(self) -> list[int]:
        """F of each."""
        return [int(m * self.pixels) for m in self.multiples]


def multiples_of(pixels: int, fragments: int) -> list[float]:
    """The budgets that views of so many pixels and fragments are scored at, of W H."""
    return [m for m in MULTIPLES if m * pixels < MOST_SHARE * fragments]


def views_of(store: Store, folders: Sequence[Path], size: tuple[int, int], most: int) -> list[ViewRow]:
    """Every view that has a budget. What was captured before is not captured again.

    Stages are told apart by name, size and views alone: after another change of the renderer delete the folder `dumps`.

    Args:
        store: Where they are kept.
        folders: Each with scenes and MANIFEST.json, beside the project's own scenes.
        size: Pixels per row, rows.
        most: Views of a stage, in each mode.
    """
    seen: Counter[str] = Counter()
    rows: list[ViewRow] = []
    described = chain.from_iterable(map(described_cases, folders))
    for case in chain(sample_cases(store.folder / "samples"), described):
        seen[case.scene] += 1
        if seen[case.scene] <= STAGES:
            key = key_of(case.scene, case.path.name, case.variants, size, most, store.code("dumps"))
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
        for view in chain(captured_views(case, size, most), _of_materials(case, size, most)):
            dump = view.dump
            if dump is None or not multiples_of(dump.pixels, dump.total):
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


def _of_materials(case: Case, size: tuple[int, int], most: int) -> Iterator[CapturedView]:
    """The views of a stage whose materials have drawn opacities: always the same for the same stage."""
    seed = int(key_of(case.scene, case.path.name)[:8], 16)
    scene = drawn_opacities(load_scene(case.path, LoadOptions(alpha=BASE_ALPHA, variants=case.variants)), seed)
    yield from views_of_scene(case, scene, MATERIALS, size, most)
