"""What a stress suite reports: how far a fast path was from float64, and how far it may be.

A suite is a function `run(options: Options) -> Iterator[Row]`; `evaluation.stress.suites` lists them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

Measure = Literal["absolute", "relative"]

INFORMATION: float = math.inf
"""The bound of a row that shows something and judges nothing, such as the error of a formula that is not used."""


@dataclass(frozen=True, slots=True)
class Options:
    """How much is tried.

    Attributes:
        quick: Smaller inputs and fewer of them, for tests and a first look.
        seed: Of everything random.
        search: Seconds that each search for a worst case may take; 0 leaves the searches out.
    """

    quick: bool = False
    seed: int = 0
    search: float = 0.0


@dataclass(frozen=True, slots=True)
class Bound:
    """What a fast path may be off, and why so much.

    Attributes:
        value: Largest error allowed.
        measure: Which error that is.
        floor: Relative errors are relative to `max(|reference|, floor)`.
        why: Reason, in words of docs/STRESS.md.
    """

    value: float
    measure: Measure
    floor: float
    why: str


@dataclass(frozen=True, slots=True)
class Finding:
    """The worst that one fast path did on one input.

    Attributes:
        path: The fast path: `curves`, `predict.onnx`, `abuffer-list · llvmpipe`.
        case: The input: `alpha 1/255, n 4096`.
        absolute: Largest absolute error against float64. Where a count has to be 0, that count.
        relative: Largest error relative to `max(|reference|, floor)`; docs/STRESS.md states each floor.
        where: Where it was largest: `pixel 17, k 3`.
        bound: Allowed; `INFORMATION` for a row that is not judged.
        measure: Which of both errors the bound is for.
    """

    path: str
    case: str
    absolute: float
    relative: float
    where: str
    bound: float
    measure: Measure

    @property
    def error(self) -> float:
        """The error that the bound is for."""
        return self.absolute if self.measure == "absolute" else self.relative

    @property
    def ok(self) -> bool:
        """Whether the error is within the bound; NaN never is."""
        return self.error <= self.bound

    @property
    def judged(self) -> bool:
        """Whether the row has a bound at all."""
        return math.isfinite(self.bound)


@dataclass(frozen=True, slots=True)
class NotRun:
    """A fast path that this machine cannot run. Not a violation, but said.

    Attributes:
        path: The fast path.
        why: What is missing.
    """

    path: str
    why: str


@dataclass(frozen=True, slots=True)
class Broken:
    """A suite that ended with an exception: a violation.

    Attributes:
        path: The suite.
        why: The exception, in one line.
    """

    path: str
    why: str


Row: TypeAlias = Finding | NotRun | Broken
Suite: TypeAlias = Callable[[Options], Iterator[Row]]


def worst_of(findings: Sequence[Finding], case: str) -> Finding:
    """One row for several of one path: the worst of them, which says in `where` from which case it is."""
    worst = max(findings, key=lambda finding: _size(finding.error))
    where = worst.where if worst.error == 0.0 else f"{worst.case}: {worst.where}"
    absolute = max(_size(finding.absolute) for finding in findings)
    relative = max(_size(finding.relative) for finding in findings)
    return replace(worst, case=case, absolute=absolute, relative=relative, where=where)


def _size(error: float) -> float:
    """NaN is the worst of all errors; `max` alone would lose it."""
    return math.inf if math.isnan(error) else error


def compared(
    path: str,
    case: str,
    found: ArrayLike,
    reference: ArrayLike,
    bound: float,
    measure: Measure = "absolute",
    floor: float = 1.0,
    where: Callable[[tuple[int, ...]], str] = lambda index: "row " + ", ".join(map(str, index)),
) -> Finding:
    """The worst entry of an array.

    Args:
        path: The fast path.
        case: The input.
        found: What the fast path made, any shape.
        reference: float64 of the same shape.
        bound: Allowed.
        measure: Which error the bound is for.
        floor: Errors are relative to `max(|reference|, floor)`.
        where: Names an index of the arrays.

    Returns:
        The finding; `where` is of the error that `measure` names. A value that is not finite where the reference
        is, is an infinite error.
    """
    truth = np.asarray(reference, dtype=np.float64)
    values = np.asarray(found, dtype=np.float64)
    if values.shape != truth.shape:
        raise ValueError(f"{path}: shape {values.shape} is compared with {truth.shape}")
    if truth.size == 0:
        return Finding(path, case, 0.0, 0.0, "nothing", bound, measure)
    with np.errstate(invalid="ignore"):
        absolute = np.abs(values - truth)
    absolute[~np.isfinite(absolute)] = math.inf
    absolute[values == truth] = 0.0  # infinities of one sign
    relative = absolute / np.maximum(np.abs(truth), floor)
    worst = np.unravel_index(np.argmax(absolute if measure == "absolute" else relative), truth.shape)
    place = where(tuple(int(i) for i in worst))
    return Finding(path, case, float(absolute.max()), float(relative.max()), place, bound, measure)
