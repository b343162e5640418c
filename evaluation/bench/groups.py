"""Means over views: what the tables, charts and pages of a benchmark show."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass

from evaluation.bench.account import Account, account_of
from evaluation.report.fronts import said
from evaluation.summary import MSE_FLOOR, ORACLE, geometric_mean, mean
from renderer.techniques import TECHNIQUES
from schemas.bench import BenchCell, BenchView, CellKey
from schemas.tail import DEFAULT_TAIL, DENSITY_G

ORDER = list(TECHNIQUES)
ORACLE_WORDS = "Algorithm 1 (offline)"
"""DHOIT's "optimal k-buffer", which scores divide by."""


@dataclass(frozen=True, slots=True)
class Row:
    """A cell over some views. Errors and scores are geometric means, all else arithmetic ones, unless it is said.

    Attributes:
        key: The cell.
        family: Of the technique.
        views: Number of views it was measured on.
        averaged: How many of them are in its errors and scores: those that no budget holds entirely, so that all
            budgets average the same ones.
        exact_views: How many of them its budget holds entirely.
        mse: See `schemas.bench.BenchCell`, with a floor of `evaluation.summary.MSE_FLOOR`; None for exact techniques.
        mse_linear: Likewise.
        mse_occupied: Likewise.
        psnr: Of `mse`, dB.
        ssim: Mean.
        flip: Mean.
        ms: Frame: mean of the medians.
        spread: Frame: largest of (most - least) / median.
        passes: Pass -> mean of the medians, over the views that had it.
        gpu: The same by timer queries.
        score: q.
        over_optimum: Over the certified optimum of the same tail.
        captured: Fragments.
        of_all: `captured` over all fragments.
        k: Least and most.
        pool_bytes: Largest.
        total_bytes: Largest.
        pixel_bytes: Largest.
        fits: Whether all its pools fit one storage buffer. Bytes and this also count views without a picture.
        flicker: Mean.
        flicker_k: Mean.
        account: What its frames do; None: it was not counted.
        problem: Why there is none, where no view has one.
    """

    key: CellKey
    family: str
    views: int
    averaged: int
    exact_views: int
    mse: float | None
    mse_linear: float | None
    mse_occupied: float | None
    psnr: float | None
    ssim: float | None
    flip: float | None
    ms: float | None
    spread: float | None
    passes: dict[str, float]
    gpu: dict[str, float]
    score: float | None
    over_optimum: float | None
    captured: float | None
    of_all: float | None
    k: tuple[int, int] | None
    pool_bytes: int | None
    total_bytes: int | None
    pixel_bytes: int | None
    fits: bool
    flicker: float | None
    flicker_k: float | None
    account: Account | None
    problem: str | None

    @property
    def is_runnable(self) -> bool:
        """Whether a renderer can have it: it needs no allocation made with all fragments known."""
        return self.key.technique != ORACLE


@dataclass(frozen=True, slots=True)
class Group:
    """Views that are averaged.

    Attributes:
        title: Scene, opacity, size.
        views: The views.
        rows: Their cells, in the order of the techniques.
    """

    title: str
    views: tuple[BenchView, ...]
    rows: tuple[Row, ...]

    @property
    def depth(self) -> float:
        """N / WH: transparent fragments per pixel, mean over the views."""
        return mean([depth_of(view) for view in self.views]) or 0.0


@dataclass(frozen=True, slots=True)
class Offline:
    """An offline allocation over the views of a group: geometric means, as of `Row`.

    Attributes:
        rule: In words.
        budget_factor: F / WH.
        mse: As of `Row`, over views that the budget does not hold entirely.
        gap: Largest of the certified optimum; None for the oracle.
        captured: Mean fragments.
        k: Least and most.
    """

    rule: str
    budget_factor: float
    mse: float
    gap: float | None
    captured: float
    k: tuple[int, int]


def offline(shown: Group) -> list[Offline]:
    """Oracle and certified optima of a group, by budget."""
    marks = [(mark, view) for view in shown.views for mark in view.yardsticks if mark.budget < view.fragments]
    held = _held(shown.views)["fragments"]
    marks = [(mark, view) for mark, view in marks if view.key not in held] or marks
    keys = sorted({(mark.budget_factor, mark.rule, mark.tail, mark.g or 0.0) for mark, _ in marks})
    made = []
    for factor, rule, tail, g in keys:
        found = [m for m, _ in marks if (m.budget_factor, m.rule, m.tail, m.g or 0.0) == (factor, rule, tail, g)]
        mse = geometric_mean([max(mark.mse, MSE_FLOOR) for mark in found])
        captured = mean([float(mark.captured_fragments) for mark in found])
        gaps = [mark.gap for mark in found if mark.gap is not None]
        k = min(mark.k_min for mark in found), max(mark.k_max for mark in found)
        words = f"{ORACLE_WORDS if rule == 'greedy' else 'certified optimum'}, {tail} tail"
        made.append(Offline(words, factor, mse or 0.0, max(gaps, default=None), captured or 0.0, k))
    return made


def groups_of(views: Sequence[BenchView]) -> list[Group]:
    """One group for each scene, opacity and size, in their order."""
    titles = dict.fromkeys(title_of(view) for view in views)
    return [group(title, [view for view in views if title_of(view) == title]) for title in titles]


def group(title: str, views: Sequence[BenchView]) -> Group:
    """Rows over some views."""
    keys = dict.fromkeys(cell.key for view in views for cell in view.cells)
    held = _held(views)
    rows = [
        _row(key, [(view, cell) for view in views for cell in view.cells if cell.key == key], held[key.basis])
        for key in keys
    ]
    return Group(title, tuple(views), tuple(sorted(rows, key=_place)))


def _held(views: Sequence[BenchView]) -> dict[str, set[str]]:
    """Basis -> keys of the views that a budget holds entirely which does not hold all of them."""
    cells = [(view, cell) for view in views for cell in view.cells if cell.problem is None]
    decided = {(cell.basis, cell.budget_factor) for _, cell in cells if not cell.exact}
    held: dict[str, set[str]] = {"fragments": set(), "memory": set()}
    for view, cell in cells:
        if cell.basis in held and cell.exact and (cell.basis, cell.budget_factor) in decided:
            held[cell.basis].add(view.key)
    # What has no budget stands beside what has one.
    return {**held, "none": held["fragments"]}


def title_of(view: BenchView) -> str:
    """What a view is averaged under."""
    return f"{view.scene}, {said_setting(view)}"


def said_setting(view: BenchView) -> str:
    """Opacity and size of a view in words."""
    return f"{said_alpha(view.alpha)}, {view.width}x{view.height}"


def said_alpha(alpha: float | None) -> str:
    """Opacity in words."""
    return "authored alpha" if alpha is None else f"alpha {alpha:g}"


def depth_of(view: BenchView) -> float:
    """N / WH: transparent fragments per pixel."""
    return view.fragments / (view.width * view.height)


def said_budget(key: CellKey) -> str:
    """Budget of a cell in words: `F = 2 WH`, `M of k = 2`, or nothing."""
    if key.budget_factor is None:
        return ""
    return f"F = {key.budget_factor:g} WH" if key.basis == "fragments" else f"M of k = {key.budget_factor:g}"


def said_technique(key: CellKey) -> str:
    """Title of a technique with its tail, where that is not the default."""
    return said(key.technique, plain_tail(key))


def plain_tail(key: CellKey) -> str:
    """Tail of a cell; '' for the default."""
    tail = said_tail(key)
    return "" if tail == DEFAULT_TAIL else tail


def said_tail(key: CellKey) -> str:
    """Tail of a cell, with its g where that is not the default; '' where there is none."""
    if key.tail is None:
        return ""
    return key.tail if key.g is None or key.g == DENSITY_G else f"{key.tail} g = {key.g:g}"


def measured(rows: Iterable[Row], basis: str) -> list[Row]:
    """Rows of a basis that have times and errors."""
    return [row for row in rows if row.key.basis == basis and row.problem is None]


def _place(row: Row) -> tuple[int, float, int, str, str, str]:
    key = row.key
    bases = ("none", "fragments", "memory")
    return (
        bases.index(key.basis),
        key.budget_factor or 0.0,
        ORDER.index(key.technique),
        key.tail or "",
        key.bundle or "",
        str(key.g),
    )


def _row(key: CellKey, found: Sequence[tuple[BenchView, BenchCell]], held: Collection[str]) -> Row:
    every = [cell for _, cell in found]
    there = [(view, cell) for view, cell in found if cell.problem is None]
    cells = [cell for _, cell in there]
    decided = [cell for view, cell in there if not cell.exact and view.key not in held]
    decided = decided or [cell for cell in cells if not cell.exact]
    is_exact = TECHNIQUES[key.technique].family == "exact"
    mse = None if is_exact else _geometric(decided, lambda cell: cell.mse)
    shares = [(cell.captured_fragments or 0) / view.fragments for view, cell in there if view.fragments]
    frames = [cell.frame for cell in cells if cell.frame is not None]
    ks = [(cell.k_min, cell.k_max) for cell in cells if cell.k_min is not None and cell.k_max is not None]
    names = dict.fromkeys(name for cell in cells for name in cell.passes)
    timed = dict.fromkeys(name for cell in cells for name in cell.gpu)
    return Row(
        key=key,
        family=TECHNIQUES[key.technique].family,
        views=len(cells),
        averaged=len(decided),
        exact_views=sum(cell.exact for cell in cells),
        mse=mse,
        mse_linear=None if is_exact else _geometric(decided, lambda cell: cell.mse_linear),
        mse_occupied=None if is_exact else _geometric(decided, lambda cell: cell.mse_occupied),
        psnr=None if mse is None else mean([cell.psnr for cell in decided if cell.psnr is not None]),
        ssim=_mean(decided, lambda cell: cell.ssim),
        flip=_mean(decided, lambda cell: cell.flip),
        ms=mean([frame.median for frame in frames]),
        spread=max(((frame.most - frame.least) / frame.median for frame in frames), default=None),
        passes={
            name: mean([cell.passes[name].median for cell in cells if name in cell.passes]) or 0.0 for name in names
        },
        gpu={name: mean([cell.gpu[name] for cell in cells if name in cell.gpu]) or 0.0 for name in timed},
        score=geometric_mean([cell.score for cell in decided if cell.score is not None]),
        over_optimum=geometric_mean([cell.over_optimum for cell in decided if cell.over_optimum is not None]),
        captured=_mean(cells, lambda cell: cell.captured_fragments),
        of_all=mean(shares),
        k=(min(low for low, _ in ks), max(high for _, high in ks)) if ks else None,
        pool_bytes=_largest(every, lambda cell: cell.pool_bytes),
        total_bytes=_largest(every, lambda cell: cell.total_bytes),
        pixel_bytes=_largest(every, lambda cell: cell.pixel_bytes),
        fits=all(cell.fits for cell in every),
        flicker=_mean(decided, lambda cell: cell.flicker),
        flicker_k=_mean(decided, lambda cell: cell.flicker_k),
        account=account_of(found),
        problem=found[0][1].problem if not cells else None,
    )


def _present(cells: Iterable[BenchCell], field: Callable[[BenchCell], float | None]) -> list[float]:
    return [float(value) for cell in cells if (value := field(cell)) is not None]


def _geometric(cells: Iterable[BenchCell], field: Callable[[BenchCell], float | None]) -> float | None:
    return geometric_mean([max(value, MSE_FLOOR) for value in _present(cells, field)])


def _mean(cells: Iterable[BenchCell], field: Callable[[BenchCell], float | None]) -> float | None:
    return mean(_present(cells, field))


def _largest(cells: Iterable[BenchCell], field: Callable[[BenchCell], float | None]) -> int | None:
    return max((int(value) for value in _present(cells, field)), default=None)
