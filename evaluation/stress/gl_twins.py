"""Every technique that the stress suite renders, with its float64 twin on the same fragments."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial

import numpy as np
from numpy.typing import NDArray

from evaluation.stress.findings import Options
from evaluation.stress.gl_cases import Case, thinned
from labeller import reference
from renderer.csr import offsets_of
from renderer.reference import (
    adaptive,
    bevy,
    depth_peeling,
    dual_depth_peeling,
    exact,
    moment,
    multilayer,
    stochastic,
    storm_rules,
    wavelet,
    weighted_average,
    weighted_blended,
)
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
from renderer.techniques.bevy import POOL as BEVY_POOL
from renderer.techniques.binned import DEFAULT_BINS
from renderer.techniques.ordered import EnginePool, Ordered, capture_ordered
from renderer.techniques.storm_rules import POOL as STORM_POOL
from schemas.fragments import FragmentDump
from schemas.tail import TailName

Floats = NDArray[np.float64]
Twin = Callable[["Truth"], Floats]

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
        pool: EnginePool | None = None,
    ) -> Floats:
        """float64 [P, 3] of a twin that reads fragments in the order of submission; empty where not compared.

        Args:
            twin: Takes offsets int64 [P+1], packed colours uint32 [N], depths float32 [N] and backgrounds uint8 [P, 3],
                and returns linear RGB float64 [P, 3].
            pool: Of all pixels, compared or not: what it has no room for is lost.
        """
        found = self.ordered if pool is None else arriving(self.ordered, pool.slots * self.dump.pixels)
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
        twin: float64 [P, 3], linear RGB.
        bound: Its key in `evaluation.stress.gl_bounds.BOUNDS`.
    """

    name: str
    technique: Technique
    twin: Twin
    bound: str

    @property
    def peeled(self) -> bool:
        """Whether it takes a pass for every layer."""
        return self.bound in PEELED


def unbounded(options: Options) -> list[Unbounded]:
    """The exact and the approximate techniques; those with parameters also at the ends of them, but for a quick run."""
    twins: dict[str, Twin] = {
        "depth-peeling": lambda truth: depth_peeling.picture(truth.dump),
        "dual-depth-peeling": lambda truth: dual_depth_peeling.picture(truth.dump),
        "binned": lambda truth: truth.hybrid(np.zeros(truth.dump.pixels, int), DEFAULT_BINS),
        "weighted-average": lambda truth: weighted_average.picture(truth.dump),
        "weighted-blended": lambda truth: _blended(truth, 10),
        "moment": lambda truth: moment.picture(truth.dump),
        "multilayer": lambda truth: truth.in_order(multilayer.picture),
        "adaptive": lambda truth: truth.in_order(adaptive.picture),
        "stochastic": lambda truth: stochastic.picture(truth.dump),
        "wavelet": lambda truth: wavelet.picture(truth.dump),
        "bevy": lambda truth: truth.in_order(bevy.picture, BEVY_POOL),
        "storm-rules": lambda truth: truth.in_order(storm_rules.picture, STORM_POOL),
    }
    found = [
        Unbounded(name, technique(name), twins.get(name, lambda truth: exact.picture(truth.dump)), name)
        for name, entry in TECHNIQUES.items()
        if entry.family != "bounded"
    ]
    return found if options.quick else found + _variants()


def _variants() -> list[Unbounded]:
    many, seed = 16, 2**32 - 1
    return [
        *(
            Unbounded(
                f"weighted-blended.{equation}",
                WeightedBlended(equation),
                lambda truth, equation=equation: _blended(truth, equation),  # type: ignore[misc]
                "weighted-blended",
            )
            for equation in (7, 8, 9)
        ),
        Unbounded("moment.bias 1e-4", Moment(1e-4, 1.0), lambda truth: moment.picture(truth.dump, 1e-4, 1.0), "moment"),
        Unbounded(
            f"multilayer.{many} nodes",
            Multilayer(many),
            lambda truth: truth.in_order(partial(multilayer.picture, nodes=many)),
            "multilayer",
        ),
        Unbounded(
            f"adaptive.{many} nodes",
            Adaptive(many),
            lambda truth: truth.in_order(partial(adaptive.picture, nodes=many)),
            "adaptive",
        ),
        Unbounded(
            "stochastic.32 samples",
            Stochastic(32, seed),
            lambda truth: stochastic.picture(truth.dump, 32, seed),
            "stochastic",
        ),
    ]


def _blended(truth: Truth, equation: int) -> Floats:
    frame = truth.case.frame
    near, far = frame.view.clip_range(frame.gpu.scene.bounds)
    return weighted_blended.picture(truth.dump, near, far, equation)
