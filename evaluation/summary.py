"""Means and ratios over measurements: what tables, sentences and the registry's score are made of."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass

from evaluation.looks import technique_order
from schemas.limits import LIMITS
from schemas.measurement import Measurement

BUNDLE = "kbuffer-deep"
BASELINE = "kbuffer-importance"
ORACLE = "kbuffer-optimal"
EXACT = "sbuffer"
FIXED = "kbuffer"

MSE_FLOOR = 1e-8
"""Means and ratios take smaller errors as this one, the last digit that tables show (0.001e-5): below it, pictures
differ by single steps in a few pixels and a ratio would measure rounding."""
UNFIT = "†"
"""Mark of a pool that does not fit; see `said_unfit`."""


def geometric_mean(values: Sequence[float]) -> float | None:
    """exp(mean(log v)) of positive values; None of none."""
    return math.exp(math.fsum(map(math.log, values)) / len(values)) if values else None


def mean(values: Sequence[float]) -> float | None:
    """Arithmetic mean; None of none."""
    return math.fsum(values) / len(values) if values else None


def compared(measurements: Iterable[Measurement]) -> list[Measurement]:
    """Those that say something about a technique: it was run, and the budget did not hold every fragment anyway."""
    return [m for m in measurements if m.skipped is None and m.mse is not None and not m.exact]


def ratios(measurements: Iterable[Measurement], technique: str, baseline: str) -> list[float]:
    """The mse of `technique` over that of `baseline`, for every scene, view and budget where both were measured.

    Pairs in which neither is above `MSE_FLOOR` are left out: both are lossless, and there is nothing to compare.
    """
    table = {(m.scene, m.view, m.budget_factor, m.technique): m.mse or 0.0 for m in compared(measurements)}
    pairs = [
        (mse, table[scene, view, budget, baseline])
        for (scene, view, budget, name), mse in table.items()
        if name == technique and (scene, view, budget, baseline) in table
    ]
    return [max(ours, MSE_FLOOR) / max(theirs, MSE_FLOOR) for ours, theirs in pairs if max(ours, theirs) > MSE_FLOOR]


def score(measurements: Iterable[Measurement]) -> float | None:
    """The registry's score: geometric mean of the bundle's mse over VKB's. Lower is better; below 1 beats VKB."""
    return geometric_mean(ratios(measurements, BUNDLE, BASELINE))


@dataclass(frozen=True, slots=True)
class Row:
    """A technique at a budget, over some views.

    Attributes:
        technique: Name of the technique; more words may follow it.
        budget_factor: F / (width * height); 0 for one that reads no budget.
        mse: Geometric mean of max(mse, MSE_FLOOR) over the views that no budget holds entirely, lest a larger budget
            be judged by the harder views alone; None: there is no such view.
        psnr: That mean in dB.
        flip: Arithmetic mean.
        ms: Arithmetic mean of a frame's wall time.
        pool_bytes: Largest fragment pool.
        total_bytes: Largest total.
        views: Number of views.
        averaged: How many of them are in the means of mse, psnr and flip: the same ones in every budget.
        exact_views: How many of them the budget holds entirely.
        over_baseline: Geometric mean of mse over VKB's on the same views.
    """

    technique: str
    budget_factor: float
    mse: float | None
    psnr: float | None
    flip: float | None
    ms: float | None
    pool_bytes: int | None
    total_bytes: int | None
    views: int
    averaged: int
    exact_views: int
    over_baseline: float | None

    @property
    def is_exact(self) -> bool:
        """Whether all its pictures are: not with the fixed k, which spreads a budget evenly, and still errs."""
        return self.technique != FIXED and self.exact_views == self.views > 0


def rows(measurements: Sequence[Measurement]) -> list[Row]:
    """One row for every budget and technique, budgets ascending, techniques in the order of `technique_order`.

    The exact technique, which needs another budget in every view, has one row at the end, at the largest of them.
    """
    bounded = [m for m in measurements if m.technique != EXACT]
    exact = [m for m in measurements if m.technique == EXACT]
    held = _held(bounded)
    made = [
        _row([m for m in bounded if m.technique == technique and m.budget_factor == budget], bounded, held)
        for budget in sorted({m.budget_factor for m in bounded})
        for technique in technique_order(m.technique for m in bounded if m.budget_factor == budget)
    ]
    return [*made, _row(exact, [], ())] if exact else made


def _held(bounded: Sequence[Measurement]) -> set[tuple[str, str]]:
    """Scene and name of the views that a budget holds entirely which does not hold all of them."""
    decided = {m.budget_factor for m in bounded if not m.exact}
    return {(m.scene, m.view) for m in bounded if m.exact and m.budget_factor in decided}


def _row(group: list[Measurement], everything: Sequence[Measurement], held: Collection[tuple[str, str]]) -> Row:
    technique, budget = group[0].technique, max(m.budget_factor for m in group)
    run = [m for m in group if m.skipped is None]
    errors = compared(m for m in group if (m.scene, m.view) not in held)
    mse = geometric_mean([max(m.mse or 0.0, MSE_FLOOR) for m in errors])
    same_budget = [m for m in everything if m.budget_factor == budget and (m.scene, m.view) not in held]
    return Row(
        technique=technique,
        budget_factor=budget,
        mse=mse,
        psnr=-10.0 * math.log10(mse) if mse is not None else None,
        flip=mean(_present(errors, lambda m: m.flip)),
        ms=mean(_present(run, lambda m: m.total_ms)),
        pool_bytes=max((m.pool_bytes for m in run if m.pool_bytes is not None), default=None),
        total_bytes=max((m.total_bytes for m in run if m.total_bytes is not None), default=None),
        views=len(group),
        averaged=len(errors),
        exact_views=sum(m.exact for m in group),
        over_baseline=geometric_mean(ratios(same_budget, technique, BASELINE)),
    )


def _present(group: list[Measurement], field: Callable[[Measurement], float | None]) -> list[float]:
    return [value for m in group if (value := field(m)) is not None]


def sentence(measurements: Sequence[Measurement]) -> str:
    """What the measurements say, in words, from the pairs of the bundle and VKB that can be compared."""
    against_vkb = ratios(measurements, BUNDLE, BASELINE)
    if not against_vkb:
        return "No view and budget could be compared: there is no held-out view, or every budget holds all fragments."
    worse = sum(ratio > 1.0 for ratio in against_vkb)
    text = f"The bundle's squared error is {number(geometric_mean(against_vkb))} times that of VKB"
    if against_optimal := ratios(measurements, BUNDLE, ORACLE):
        text += f" and {number(geometric_mean(against_optimal))} times that of the optimal allocation"
    pairs = f"{len(against_vkb)} pair{'s' if len(against_vkb) > 1 else ''} of view and budget"
    verdict = "it is nowhere worse than VKB" if worse == 0 else f"it is worse than VKB in {worse}"
    return f"{text} (geometric means over {pairs}); {verdict}."


def number(value: float | None) -> str:
    """Three significant digits, without an exponent where that stays short; a dash for None."""
    if value is None:
        return "–"
    if value != 0.0 and not 1e-4 <= abs(value) < 1e5:
        return f"{value:.2e}"
    exponent = int(f"{value:.2e}".partition("e")[2])  # after rounding: 0.9999 has that of 1.00
    return f"{value:.{max(0, 2 - exponent)}f}"


def e5(error: float | None) -> str:
    """An error x1e-5; what is not above `MSE_FLOOR` is known to be no more than that."""
    if error is None or error > MSE_FLOOR:
        return number(None if error is None else 1e5 * error)
    return f"≤ {number(1e5 * MSE_FLOOR)}"


def said_unfit() -> str:
    """What `UNFIT` means."""
    most = LIMITS.buffer_bytes / 2**20
    return f"does not fit one storage buffer ({most:.0f} MiB): rendered in bands of rows, or not at all"
