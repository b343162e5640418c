"""Every technique's picture against its float64 twin, and what the bounded ones do with their budget."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from evaluation.stress.fills import whole_bins
from evaluation.stress.findings import Finding, Options, compared
from evaluation.stress.gl_bounds import bound_of
from evaluation.stress.gl_cases import Case
from evaluation.stress.gl_moment import DELICATE
from evaluation.stress.gl_network import Networks
from evaluation.stress.gl_stacks import ILL_CONDITIONED
from evaluation.stress.gl_twins import Truth, Unbounded, unbounded
from renderer.allocation.fill import budget_fill
from renderer.frame import Frame
from renderer.techniques import (
    TECHNIQUES,
    Budget,
    KBuffer,
    KBufferDeep,
    KBufferDynamic,
    KBufferOptimal,
    Moment,
    Needs,
    Rendered,
    technique,
)
from renderer.techniques.base import ChainForm
from renderer.techniques.chain import one_pass_available
from schemas.tail import BINNED_TAILS, DEFAULT_TAIL, TAIL_NAMES, TailName

BOUNDED = tuple(name for name, entry in TECHNIQUES.items() if entry.family == "bounded")
_LEARNED = tuple(name for name in BOUNDED if TECHNIQUES[name].needs_bundle)
"""Those whose cores are whole bins of their bundle's tail."""
_WHOLE = tuple(name for name in BOUNDED if name not in (KBuffer.name, KBufferDynamic.name, *_LEARNED))
"""Those that give every fragment of their budget away."""


@dataclass(frozen=True, slots=True)
class Form:
    """One way to render a technique with a budget.

    Attributes:
        path: As in the table.
        tails: That are tried.
        chain: How its chain is drawn.
    """

    path: str
    tails: tuple[TailName, ...] = TAIL_NAMES
    chain: ChainForm = "auto"


BUDGETS: Mapping[str, Callable[[int, int], int]] = {
    "0": lambda total, occupied: 0,
    "occupied - 1": lambda total, occupied: occupied - 1,
    "occupied": lambda total, occupied: occupied,
    "N/64": lambda total, occupied: total // 64,
    "N/7": lambda total, occupied: total // 7,
    "N/3": lambda total, occupied: total // 3,
    "N - 1": lambda total, occupied: total - 1,
    "N": lambda total, occupied: total,
    "2 N": lambda total, occupied: 2 * total,
}
"""F of N fragments and so many occupied pixels, by name."""


def random_allocation(frame: Frame, budget: Budget) -> NDArray[np.int32]:
    """An allocation that no rule would make: every k that a budget allows occurs somewhere."""
    n = frame.count()
    weights = np.random.default_rng(budget.fragments).random(frame.pixels) ** 4
    return budget_fill(weights, n, budget.fragments)


def steps(
    case: Case, options: Options, driver: str, networks: Networks
) -> Iterator[tuple[str, Callable[[], Iterator[Finding]]]]:
    """All techniques on a case, each with its name, rendered when called.

    Args:
        case: What is rendered.
        options: Quick runs leave out some parameters.
        driver: For the paths.
        networks: What `kbuffer-deep` predicts with.
    """
    truth = Truth.of(case)
    for each in unbounded(options):
        if not (case.scenery.deep and each.peeled):
            yield each.name, partial(picture_rows, case, truth, each, driver)
    needs = Needs(allocate=random_allocation)
    for name in BOUNDED:
        if name not in _LEARNED:
            yield name, partial(bounded_rows, case, truth, name, needs, driver)
            continue
        for tail in BINNED_TAILS:
            form, own = Form(name, (tail,)), Needs(bundle=networks.bundles[tail])
            yield f"{name}.{tail}", partial(bounded_rows, case, truth, name, own, driver, form)
    form, own = Form(f"{KBufferDeep.name}.overflowing network", (DEFAULT_TAIL,)), Needs(bundle=networks.overflowing)
    yield form.path, partial(bounded_rows, case, truth, KBufferDeep.name, own, driver, form)
    if one_pass_available(case.frame.ctx):  # the others have taken it
        form = Form(f"{KBufferOptimal.name}.two-pass", chain="two-pass")
        yield form.path, partial(bounded_rows, case, truth, KBufferOptimal.name, needs, driver, form)


def picture_rows(case: Case, truth: Truth, each: Unbounded, driver: str) -> Iterator[Finding]:
    """A technique without a budget; `moment` has a row of its own for what is ill conditioned."""
    linear = each.technique.render(case.frame, Budget(0)).linear.reshape(-1, 3)
    path = f"{each.name} · {driver}"
    expected = each.twin(truth)
    if each.bound != Moment.name:
        yield _compared(case, path, case.pixels, linear, expected, each.bound)
        return
    ill = np.array([case.stack(int(p)) in ILL_CONDITIONED for p in case.pixels])
    ill |= np.isin(case.dump.counts[case.pixels], DELICATE)
    yield _compared(case, path, case.pixels[~ill], linear, expected, "moment")
    yield _compared(
        case, f"{each.name}.ill conditioned · {driver}", case.pixels[ill], linear, expected, "moment.ill conditioned"
    )


def bounded_rows(
    case: Case, truth: Truth, name: str, needs: Needs, driver: str, form: Form | None = None
) -> Iterator[Finding]:
    """A technique with a budget: every tail, then whether budgets and k were kept."""
    made, form = technique(name, needs), form or Form(name)
    wrong: list[str] = []
    occupied = int(np.count_nonzero(case.dump.counts))
    for tail in form.tails:
        for label in case.scenery.budgets:
            fragments = BUDGETS[label](case.dump.total, occupied)
            for _ in range(min(2, TECHNIQUES[name].settles)):  # what learns from its frames has learnt in the second
                rendered = made.render(case.frame, Budget(fragments, tail, chain=form.chain))
            wrong += [f"F = {label}, {tail}: {why}" for why in broken_limits(name, rendered, case, fragments, tail)]
            linear, expected = rendered.linear.reshape(-1, 3), truth.hybrid(rendered.k, tail)
            row = _compared(case, f"{form.path}.{tail} · {driver}", case.pixels, linear, expected, "bounded")
            yield replace(row, where=f"F = {label}, {row.where}")
    count = float(len(wrong))
    bound = bound_of("bounded.limits", deep=False)
    where = f"{case.scenery.name}: {wrong[0]}" if wrong else "nowhere"
    yield Finding(f"{form.path}.F and K · {driver}", case.name, count, count, where, bound.value, bound.measure)


def broken_limits(
    name: str, rendered: Rendered, case: Case, fragments: int, tail: TailName = DEFAULT_TAIL
) -> list[str]:
    """What a picture within a budget does that it must not (METHOD.md section 3), in words."""
    n, k = case.dump.counts, rendered.k.astype(np.int64)
    whole = name in _WHOLE
    spent = min(fragments, case.dump.total)
    checks = {
        "the picture is not finite": not np.isfinite(rendered.linear).all(),
        f"sum K = {k.sum()} is above F": k.sum() > fragments,
        f"sum K = {k.sum()} leaves a part of F": whole and k.sum() != spent,
        "K is above n": bool((k > n).any()),
        "K is below 0": bool((k < 0).any()),
        "slots are not what was captured": rendered.captured != k.sum(),
    }
    if name in _LEARNED:
        checks |= _broken_bins(case, k, fragments, tail)
    return [why for why, broken in checks.items() if broken]


def _broken_bins(case: Case, k: NDArray[np.int64], fragments: int, tail: TailName) -> dict[str, bool]:
    """The same of cores of whole bins: which they are not, or which leave more than the next bin of any pixel."""
    usable = whole_bins(case.frame.kept_bins(tail).counts())
    before = np.cumsum(usable, axis=1) - usable
    waiting = np.where((before == k[:, None]) & (usable > 0), usable, 0)
    cores = (usable * (before < k[:, None])).sum(axis=1)
    left = fragments - int(k.sum())
    return {
        "cores are not whole bins": bool((cores != k).any()),
        f"{left} fragments of F are left, and more bins would fit": bool(waiting.any() and left >= waiting.max()),
    }


def _compared(
    case: Case,
    path: str,
    pixels: NDArray[np.int64],
    found: NDArray[np.floating],
    truth: NDArray[np.float64],
    key: str,
) -> Finding:
    """Some pixels of a picture and its twin, [P, 3] each."""
    bound = bound_of(key, case.scenery.deep)

    def where(index: tuple[int, ...]) -> str:
        return case.place(int(pixels[index[0]]))

    return compared(path, case.name, found[pixels], truth[pixels], bound.value, bound.measure, bound.floor, where)
