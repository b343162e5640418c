"""One pixel of a comparison: its fragments, its error curve, and the k of every rule and of both sides."""

from __future__ import annotations

import io
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from evaluation.pictures import read_png
from evaluation.report.lines import curve_chart
from evaluation.report.vega import Spec
from labeller import pixel as curves
from labeller.reference import Pixel, pixel_of
from schemas.colour import display8
from schemas.problem import ExitCode, Problem
from schemas.tail import MetricName, TailName
from services.dashboard.sides import Side
from services.kept import Kept
from stages.evaluate import evaluated_from
from stages.inputs import METRIC
from stages.store import Address, MissingArtifact, Store

if TYPE_CHECKING:
    from renderer.dump_pixels import DumpReader
    from services.dashboard.members import Members

MOST_ROWS = 256
"""Fragments that are listed."""
MOST_MODELS = 3
"""Models whose k is shown among the rules'."""

RULE_TITLES = {
    "fixed": "fixed k",
    "dynamic": "dynamic k+",
    "importance": "VKB (importance)",
    "uniform": "uniform",
    "proportional": "proportional to n",
    "greedy": "greedy (Algorithm 1)",
    "increment": "greedy by increment",
    "optimal": "optimal",
}
"""Rules of `labeller.allocation.RULES` in the order in which they are shown."""

Labelled = tuple[str, Side]
"""A side with its letter."""


@dataclass(frozen=True, slots=True)
class Ground:
    """What the k of a side means: fragments, and how those in the tail are averaged.

    Attributes:
        dump: Artifact with the fragments.
        tail: Of the evaluation.
        g: Steepness of the density tail.
    """

    dump: str
    tail: TailName
    g: float


@dataclass(frozen=True, slots=True)
class Fragment:
    """A fragment as it is listed.

    Attributes:
        number: From 1, front to back.
        depth: Metres.
        colour: As displayed on its own and opaque, `#rrggbb`.
        alpha: Opacity.
        passes: What passes all fragments in front of it.
        error: `e_p(k)` if the core ends with it.
        is_vertex: Whether that k is a vertex of the lower hull.
        core: For each side with a k: whether it belongs to the core.
    """

    number: int
    depth: float
    colour: str
    alpha: float
    passes: float
    error: float
    is_vertex: bool
    core: tuple[bool, ...]


@dataclass(frozen=True, slots=True)
class Chosen:
    """A k of the pixel, and what follows from it.

    Attributes:
        title: Who chose it.
        k: Fragments of the core; None: it is not kept.
        error: `e_p(k)`.
        colour: What is displayed, `#rrggbb`.
    """

    title: str
    k: int | None
    error: float | None = None
    colour: str | None = None


@dataclass(frozen=True, slots=True)
class Rules:
    """The k of every rule at a budget.

    Attributes:
        factor: F / (W H).
        is_kept: Whether the labels are, so that the rules are among `chosen`.
        chosen: Rules, then the latest models with a picture at that budget.
    """

    factor: float
    is_kept: bool
    chosen: tuple[Chosen, ...]


@dataclass(frozen=True, slots=True)
class Looked:
    """A pixel on the ground of one or both sides.

    Attributes:
        letters: Of those sides with a k, in the order of `Fragment.core`.
        missing: Why there is nothing to show; empty otherwise.
        tail: Of the ground.
        n: Number of fragments.
        fragments: The first `MOST_ROWS` of them.
        sides: What the sides chose.
        exact: `#rrggbb` of the exact colour.
        background: `#rrggbb` of what lies behind.
        rules: By budget.
        chart: Curve and hull; None if the pixel is exact for every k.
    """

    letters: tuple[str, ...] = ()
    missing: str = ""
    tail: str = ""
    n: int = 0
    fragments: tuple[Fragment, ...] = ()
    sides: tuple[Chosen, ...] = ()
    exact: str = ""
    background: str = ""
    rules: tuple[Rules, ...] = ()
    chart: Spec | None = None


class Inspector:
    """Looks at single pixels of stored dumps.

    Args:
        store: Where artifacts lie.
        kept: Where parts of dumps and allocations, and maps of k, are kept between two looks.
    """

    def __init__(self, store: Store, kept: Kept) -> None:
        self._store, self._kept = store, kept

    def look(self, sides: Sequence[Labelled], models: Sequence[Side], p: int) -> list[Looked]:
        """The pixel, once for each ground that the sides have.

        Args:
            sides: The two sides.
            models: Pictures of models on the same view, whose k is shown among the rules'.
            p: Index of the pixel, y * width + x.
        """
        grounds: dict[Ground | None, list[Labelled]] = {}
        for letter, side in sides:
            try:
                ground = self._ground(side)
            except MissingArtifact:
                ground = None
            grounds.setdefault(ground, []).append((letter, side))
        return [self._on(ground, on_it, models, p) for ground, on_it in grounds.items()]

    def prepare(self, sides: Sequence[Side]) -> None:
        """Reads what every pixel of some sides needs, so that the first one that is looked at comes as fast."""
        for side in sides:
            with suppress(MissingArtifact, Problem):
                self._reader(self._ground(side).dump)

    def _ground(self, side: Side) -> Ground:
        address = self._made_from(side)
        return Ground(evaluated_from(address.inputs)[0], address.params["tail"], float(address.params["g"]))

    def _made_from(self, side: Side) -> Address:
        """Address of a side's artifact; it is named by its content, so that one that is kept stays right."""
        artifact = side.shot.artifact
        return self._kept.get(
            ("address", artifact), lambda: self._store.made_from(artifact), lambda made: len(repr(made))
        )

    def _on(self, ground: Ground | None, sides: Sequence[Labelled], models: Sequence[Side], p: int) -> Looked:
        names = " and ".join(letter for letter, _ in sides)
        if ground is None:
            return Looked(missing=f"The pictures of {names} were removed because of their age.")
        try:
            dump = self._reader(ground.dump).pixel(p)
        except (MissingArtifact, Problem) as reason:
            _require_absence(reason)
            return Looked(missing=f"The fragments behind {names} were removed because of their age.")
        metric: MetricName = METRIC
        one = pixel_of(dump, 0)
        colours = curves.colours(one, ground.tail, ground.g)
        errors = curves.errors(colours, metric)
        hull = curves.hull(errors)

        def chosen(title: str, k: int | None) -> Chosen:
            if k is None:
                return Chosen(title, None)
            k = min(k, one.n)
            return Chosen(title, k, float(errors[k]), _hex(colours[k]))

        own = [(letter, chosen(f"{letter}: {side.title}", self._k(side, one.n, p))) for letter, side in sides]
        known = [(letter, side.k) for letter, side in own if side.k is not None]
        rules = []
        for factor, side in _by_budget(sides).items():
            k = self._rules(side, p)
            same = [model for model in models if model.shot.measured.budget == side.shot.measured.budget]
            found = [*k.items(), *((model.name, self._k(model, one.n, p)) for model in same[:MOST_MODELS])]
            rules.append(Rules(factor, bool(k), tuple(chosen(title, count) for title, count in found)))
        return Looked(
            letters=tuple(letter for letter, _ in known),
            tail=ground.tail,
            n=one.n,
            fragments=_fragments(one, dump.rgba, errors, set(hull), [k for _, k in known]),
            sides=tuple(side for _, side in own),
            exact=_hex(colours[-1]),
            background=_hex(one.background),
            rules=tuple(rules),
            chart=_chart(errors, hull, known, rules) if one.n else None,
        )

    def _reader(self, artifact: str) -> DumpReader:
        from renderer.dump import GROUP  # imported late: nothing else of the API needs zarr
        from renderer.dump_pixels import DumpReader

        group = self._group(artifact, GROUP)
        return self._kept.get(artifact, lambda: DumpReader(group), lambda made: made.bytes)

    def _group(self, artifact: str, name: str) -> Members:
        """A zarr group of an artifact.

        Raises:
            MissingArtifact: It is gone, though some of its files may be kept.
        """
        from services.dashboard.members import Members  # imported late, as above

        if not self._store.holds(artifact):
            raise MissingArtifact(artifact)
        return Members(self._store, self._kept, artifact, name)

    def _k(self, side: Side, n: int, p: int) -> int | None:
        """What a side keeps apart in the pixel; None if its map is not kept."""
        if side.is_exact:
            return n
        if side.counts is None:
            return None
        try:
            counts = counts_of(self._store, self._kept, side.shot.artifact, side.counts)
        except (MissingArtifact, FileNotFoundError):
            return None
        return int(counts.reshape(-1)[p])

    def _rules(self, side: Side, p: int) -> dict[str, int]:
        """Title of each rule -> its k at a side's budget; empty if the labels are not kept."""
        from stages.allocations import GROUP, pixel_allocations  # imported late, as above

        try:
            _, labels = evaluated_from(self._made_from(side).inputs)
            k = pixel_allocations(self._group(labels, GROUP), side.shot.measured.budget, p)
        except (MissingArtifact, Problem) as reason:
            _require_absence(reason)
            return {}
        return {title: k[rule] for rule, title in RULE_TITLES.items() if rule in k}


def counts_of(store: Store, kept: Kept, artifact: str, file: str) -> NDArray[np.integer]:
    """A map of k, integers [H, W].

    Args:
        store: Where artifacts lie.
        kept: Where maps are kept.
        artifact: The evaluation.
        file: Name of the map.

    Raises:
        MissingArtifact: The artifact is gone.
        FileNotFoundError: It has no such map.
    """

    def read() -> NDArray[np.integer]:
        return np.asarray(read_png(io.BytesIO(store.read(artifact, file))))

    return kept.get((artifact, file), read, lambda made: made.nbytes)


def _require_absence(reason: Exception) -> None:
    """Raises what says more than that an artifact is gone or damaged: a store that cannot be reached."""
    if isinstance(reason, Problem) and reason.code != ExitCode.CONFLICT:
        raise reason


def _by_budget(sides: Iterable[Labelled]) -> dict[float, Side]:
    return {side.shot.measured.budget_factor: side for _, side in sides if not side.is_exact}


def _fragments(
    one: Pixel, rgba: NDArray[np.uint8], errors: NDArray[np.float32], hull: set[int], cores: Sequence[int]
) -> tuple[Fragment, ...]:
    passes = curves.transmittances(one)
    colours = display8(one.colour)
    return tuple(
        Fragment(
            number=i + 1,
            depth=float(one.depth[i]),
            colour="#{:02x}{:02x}{:02x}".format(*colours[i].tolist()),
            alpha=int(rgba[i, 3]) / 255.0,
            passes=float(passes[i]),
            error=float(errors[i + 1]),
            is_vertex=i + 1 in hull,
            core=tuple(i < k for k in cores),
        )
        for i in range(min(one.n, MOST_ROWS))
    )


def _chart(
    errors: NDArray[np.float32], hull: Sequence[int], sides: Sequence[tuple[str, int]], rules: Sequence[Rules]
) -> Spec | None:
    chosen: dict[int, list[str]] = {}
    for letter, k in sides:
        chosen.setdefault(k, []).append(letter)
    for at in rules:
        for one in at.chosen:
            if one.k is not None:
                chosen.setdefault(one.k, []).append(f"{one.title} at {at.factor:g}")
    what = f"Error of the pixel by the number of core fragments, 0 to {len(errors) - 1}, and its lower hull"
    return curve_chart(errors.tolist(), hull, chosen, what)


def _hex(linear: NDArray[np.float64]) -> str:
    return "#{:02x}{:02x}{:02x}".format(*display8(linear).tolist())
