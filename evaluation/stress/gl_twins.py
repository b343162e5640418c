"""Every technique that the stress suite renders, with its float64 twin on the same fragments."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from importlib import import_module

import numpy as np
from numpy.typing import NDArray

from evaluation.stress.findings import Options
from evaluation.stress.gl_cases import Case, thinned
from labeller import reference
from renderer.csr import offsets_of
from renderer.reference.arrivals import arriving
from renderer.techniques import (
    TECHNIQUES,
    Adaptive,
    Moment,
    Multilayer,
    Stochastic,
    Technique,
    WeightedBlended,
    technique,
)
from renderer.techniques.ordered import Ordered, capture_ordered
from renderer.techniques.weighted_blended import Equation
from schemas.fragments import FragmentDump
from schemas.tail import TailName

Floats = NDArray[np.float64]

PEELED = ("depth-peeling", "dual-depth-peeling")


@dataclass(slots=True)
class Truth:
    """What twins read of a case: the fragments of the pixels that are compared, sorted and as submitted.

    Attributes:
        case: The case.
        dump: Of all pixels, those that are not compared without fragments.
    """

    case: Case
    dump: FragmentDump
    _ordered: Ordered | None = None
    _pixels: dict[int, reference.Pixel] = field(default_factory=dict)
    _colours: dict[tuple[int, int, TailName], Floats] = field(default_factory=dict)

    @classmethod
    def of(cls, case: Case) -> Truth:
        """Of the pixels that a case compares."""
        return cls(case, thinned(case.dump, case.pixels))

    @property
    def ordered(self) -> Ordered:
        """All fragments in the order of submission."""
        if self._ordered is None:
            self._ordered = capture_ordered(self.case.frame)
        return self._ordered

    def in_order(
        self,
        twin: Callable[[NDArray[np.int64], NDArray[np.uint32], NDArray[np.float32], NDArray[np.uint8]], Floats],
        slots: int | None = None,
    ) -> Floats:
        """float64 [P, 3] of a twin that reads fragments in the order of submission; empty where not compared.

        Args:
            twin: Takes offsets int64 [P+1], packed colours uint32 [N], depths float32 [N] and backgrounds uint8 [P, 3],
                and returns linear RGB float64 [P, 3].
            slots: Per pixel, in a pool of all of them, compared or not: what it has no room for is lost; None: all
                are kept.
        """
        found = self.ordered if slots is None else arriving(self.ordered, slots * self.dump.pixels)
        counts = np.diff(found.offsets)
        compared = self.dump.counts > 0
        kept = np.repeat(compared, counts)
        return twin(offsets_of(counts * compared), found.packed[kept], found.depth[kept], self.dump.background)

    def hybrid(self, k: NDArray[np.integer], tail: TailName) -> Floats:
        """float64 [P, 3], the pixels with k core fragments and a tail (METHOD.md section 2); NaN if not compared.

        Args:
            k: Integers [P], core fragments of each pixel.
            tail: How the others are approximated.
        """
        made = np.full((self.dump.pixels, 3), np.nan)
        for p in self.case.pixels.tolist():
            made[p] = self._hybrid(p, int(k[p]), tail)
        return made

    def _hybrid(self, p: int, k: int, tail: TailName) -> Floats:
        if (p, k, tail) not in self._colours:
            if p not in self._pixels:
                self._pixels[p] = reference.pixel_of(self.dump, p)
            self._colours[p, k, tail] = reference.composite(self._pixels[p], k, tail)
        return self._colours[p, k, tail]


@dataclass(frozen=True, slots=True)
class Unbounded:
    """A technique that reads no budget.

    Attributes:
        name: As in the table, with its parameters.
        technique: Renders.
    """

    name: str
    technique: Technique

    @property
    def bound(self) -> str:
        """Key in `evaluation.stress.gl_bounds.BOUNDS`."""
        return self.technique.name

    @property
    def peeled(self) -> bool:
        """Whether it takes a pass for every layer."""
        return self.bound in PEELED

    def twin(self, truth: Truth) -> Floats:
        """float64 [P, 3], linear RGB, by the computation that the technique's class names.

        Args:
            truth: What it reads.
        """
        declared, parameters = self.technique.twin, self.technique.parameters(truth.case.frame)
        if declared.module is None:
            return truth.hybrid(np.zeros(truth.dump.pixels, int), **parameters)
        picture = import_module(f"renderer.reference.{declared.module}").picture
        if declared.takes == "submitted":
            return truth.in_order(partial(picture, **parameters), declared.slots)
        made: Floats = picture(truth.dump, **parameters)
        return made


def unbounded(options: Options) -> list[Unbounded]:
    """The exact and the approximate techniques; those with parameters also at the ends of them, but for a quick run."""
    found = [Unbounded(name, technique(name)) for name, each in TECHNIQUES.items() if each.family != "bounded"]
    return found if options.quick else found + _variants()


def _variants() -> list[Unbounded]:
    many, seed = 16, 2**32 - 1
    equations: tuple[Equation, ...] = (7, 8, 9)
    return [
        *(Unbounded(f"weighted-blended.{equation}", WeightedBlended(equation)) for equation in equations),
        Unbounded("moment.bias 1e-4", Moment(1e-4, 1.0)),
        Unbounded(f"multilayer.{many} nodes", Multilayer(many)),
        Unbounded(f"adaptive.{many} nodes", Adaptive(many)),
        Unbounded("stochastic.32 samples", Stochastic(32, seed)),
    ]
