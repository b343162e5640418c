"""The cells of one view: pictures, for errors and bytes; times in turns; accounts of work; the camera path."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evaluation.bench.album import Album
from evaluation.bench.cells import FIXED, Bundle, fragments_within
from evaluation.bench.flicker import measure_flicker
from evaluation.bench.options import BenchOptions
from evaluation.bench.rounds import Run, in_turns
from evaluation.bench.subject import ORACLE_TAIL, Errors, Subject
from renderer.exact_bytes import exact_bytes, fits
from renderer.techniques import TECHNIQUES, Budget, Needs, Rendered, Technique, technique
from schemas.bench import LOSSLESS, BenchCell, CellKey, Yardstick
from schemas.colour import display8
from schemas.problem import ExitCode, Problem
from schemas.tail import DENSITY_G, TailName

_UNREAD = 2.0
"""Budget as a multiple of the pixels, for techniques that read none."""


@dataclass(slots=True)
class _Bytes:
    """Bytes a pixel beside the pool and before it, and of everything."""

    pixel: int
    early: int
    total: int


@dataclass(slots=True)
class Bench:
    """A view being measured.

    Args:
        subject: The view.
        options: What was asked for.
        bundle: For the techniques that need one.
        album: Keeps the pictures.
    """

    subject: Subject
    options: BenchOptions
    bundle: Bundle | None
    album: Album | None = None
    _cells: dict[CellKey, BenchCell] = field(default_factory=dict)
    _runs: list[Run] = field(default_factory=list)
    _bytes: dict[CellKey, _Bytes] = field(default_factory=dict)
    _seen: dict[tuple[Any, ...], tuple[dict[str, Any], Errors]] = field(default_factory=dict)
    _marks: dict[tuple[str, TailName, float | None, float], Yardstick] = field(default_factory=dict)

    def measure(self, keys: Sequence[CellKey]) -> tuple[list[Yardstick], list[BenchCell]]:
        """Yardsticks and cells, in the order of the keys."""
        self._measure_yardsticks(keys)
        for key in sorted(keys, key=lambda key: key.basis == "memory"):
            self._cells[key] = self._pictured(key)
        timed = [run for run in self._runs if run.key.basis != "memory"]
        in_turns(self.subject, timed, self.options.repeats, self.options.limit)
        for run in timed:
            times = {"repeats": len(run.recordings), "passes": run.passes(), "gpu": run.gpu(), "frame": run.frame()}
            self._cells[run.key] = self._cells[run.key].model_copy(update=times)
        closer = [run for run in timed if self.options.is_closer(run.key)]
        if self.options.account:
            for run in closer:
                self._cells[run.key] = self._cells[run.key].model_copy(update={"work": run.work(self.subject)})
        if self.options.path:
            for key, found in measure_flicker(self.subject, closer, self.options.path).items():
                update = {"flicker": found.colour, "flicker_k": found.k}
                self._cells[key] = self._cells[key].model_copy(update=update)
        return list(self._marks.values()), [self._cells[key] for key in keys]

    def _measure_yardsticks(self, keys: Sequence[CellKey]) -> None:
        tails = dict.fromkeys((key.tail, key.g) for key in keys if key.tail is not None)
        found = self.subject.yardsticks("greedy", ORACLE_TAIL, DENSITY_G, self.options.factors)
        for tail, g in tails:
            found += self.subject.yardsticks("optimal", tail, DENSITY_G if g is None else g, self.options.factors)
        self._marks = {(mark.rule, mark.tail, mark.g, mark.budget_factor): mark for mark in found}

    def _pictured(self, key: CellKey) -> BenchCell:
        """A cell with everything but times and flicker."""
        about = {**key.model_dump(), "family": TECHNIQUES[key.technique].family}
        fragments = self._fragments(key)
        if key.basis != "none":
            about |= {"budget": max(fragments, 0), "exact": fragments >= self.subject.dump.total}
        if fragments < 1:
            return BenchCell(**about, problem="the buffers of the pixels alone take more than this memory")
        # Another memory may hold the same number of fragments.
        same = key.technique, key.tail, key.g, fragments
        if key.basis == "memory" and same in self._seen:
            facts, errors = self._seen[same]
            return BenchCell(**about, **facts, **self._judged(key, errors, bool(about.get("exact"))))
        run = self._run(key, fragments)
        try:
            rendered = run.first(self.subject, self.options.limit)
        except Problem as problem:
            if problem.code != ExitCode.LIMIT:
                raise
            return BenchCell(**about, **needed(key, self.subject.dump.counts), problem=problem.title)
        wrong = np.count_nonzero(~np.isfinite(rendered.linear).all(axis=2))
        if wrong:
            return BenchCell(**about, problem=f"{wrong:,} pixels of the picture are no numbers")
        self._runs.append(run)
        self._bytes[key] = _Bytes(rendered.pixel_bytes, rendered.early_bytes, rendered.total_bytes)
        if self.album is not None:
            self.album.keep(key, display8(rendered.linear))
        facts, errors = self._seen[same] = self._facts(rendered), self.subject.errors(rendered)
        return BenchCell(**about, **facts, **self._judged(key, errors, bool(about.get("exact"))))

    def _fragments(self, key: CellKey) -> int:
        """F of a cell; less than 1 where there is no room for any."""
        factor = _UNREAD if key.budget_factor is None else key.budget_factor
        given = self.subject.budgets([factor])[0]
        if key.basis != "memory":
            return given
        fixed = self._bytes_of(key.model_copy(update={"technique": FIXED, "basis": "fragments", "bundle": None}))
        own = self._bytes_of(key.model_copy(update={"basis": "fragments"}))
        return fragments_within(fixed.total, self.subject.pixels, own.pixel, own.early)

    def _bytes_of(self, key: CellKey) -> _Bytes:
        """Bytes of a cell at equal F, from its picture, or from one that is made for this."""
        if key not in self._bytes:
            rendered = self._run(key, self._fragments(key)).first(self.subject, self.options.limit)
            self._bytes[key] = _Bytes(rendered.pixel_bytes, rendered.early_bytes, rendered.total_bytes)
        return self._bytes[key]

    def _run(self, key: CellKey, fragments: int) -> Run:
        budget = Budget(fragments)
        if key.tail is not None:
            budget = Budget(fragments, key.tail, DENSITY_G if key.g is None else key.g)
        return Run(key, self._technique(key), budget)

    def _technique(self, key: CellKey) -> Technique:
        folder = None if self.bundle is None else self.bundle.folder
        needs: Needs = replace(self.options.needs, bundle=folder, allocate=self.subject.allocate)
        return technique(key.technique, needs)

    def _facts(self, rendered: Rendered) -> dict[str, Any]:
        k = rendered.k[self.subject.dump.counts > 0]
        return {
            "k_min": int(k.min()) if len(k) else 0,
            "k_max": int(k.max(initial=0)),
            "captured_fragments": rendered.captured,
            "pool_bytes": rendered.pool_bytes,
            "pixel_bytes": rendered.pixel_bytes,
            "early_bytes": rendered.early_bytes,
            "total_bytes": rendered.compared_bytes,
            "fits": fits(0 if rendered.node_bytes else rendered.pool_bytes),  # nodes are emulated in a pool
            "skips": {what: int(count) for what, count in rendered.skips.items() if count},
        }

    def _judged(self, key: CellKey, errors: Errors, is_exact: bool) -> dict[str, Any]:
        """Errors, and what they are over those of the yardsticks where something had to be decided."""
        judged: dict[str, Any] = asdict(errors)
        if key.budget_factor is None or key.tail is None or is_exact:
            return judged
        oracle = self._marks["greedy", ORACLE_TAIL, None, key.budget_factor]
        optimum = self._marks["optimal", key.tail, key.g, key.budget_factor]
        if oracle.budget >= self.subject.dump.total:
            return judged
        return {
            **judged,
            "score": over(errors.mse, oracle.mse),
            "score_display": over(errors.mse_display, oracle.mse_display),
            "over_optimum": over(errors.mse, optimum.mse),
        }


def needed(key: CellKey, n: NDArray[np.integer]) -> dict[str, Any]:
    """Fields of a cell without a picture: the bytes that an exact technique would need; nothing for others.

    Args:
        key: The cell.
        n: Transparent fragments of each pixel, int [P].
    """
    found = exact_bytes(key.technique, n)
    if found is None:
        return {}
    return {
        "pool_bytes": found.pool,
        "pixel_bytes": found.pixel,
        "total_bytes": found.total,
        "fits": fits(found.pool),
    }


def without_pictures(keys: Sequence[CellKey], n: NDArray[np.integer], problem: Problem) -> list[BenchCell]:
    """Cells of a view that has too many fragments for an exact picture: there is nothing to compare with.

    Args:
        keys: The cells.
        n: Transparent fragments of each pixel, int [P].
        problem: Why.
    """
    return [
        BenchCell(**key.model_dump(), family=TECHNIQUES[key.technique].family, **needed(key, n), problem=problem.title)
        for key in keys
    ]


def over(error: float, reference: float) -> float:
    """`(error + LOSSLESS) / (reference + LOSSLESS)`."""
    return (error + LOSSLESS) / (reference + LOSSLESS)
