"""The fragments of a view, and how many of them every pixel deserves."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, fields
from functools import wraps
from typing import Concatenate, ParamSpec, Self

from numpy.typing import ArrayLike

import labeller
from diaphane import figures, shown
from evaluation.summary import number
from evaluation.wording import counted
from labeller.allocation import Allocation
from labeller.api import fragments_of
from schemas.fragments import FragmentDump

P = ParamSpec("P")


@dataclass(frozen=True, slots=True, repr=False, eq=False)
class Fragments(FragmentDump):
    """Every transparent fragment of a view: a `schemas.fragments.FragmentDump` that shows itself."""

    @classmethod
    def of(cls, dump: FragmentDump) -> Self:
        """The same arrays."""
        return cls(**{field.name: getattr(dump, field.name) for field in fields(FragmentDump)})

    def __repr__(self) -> str:
        return f"<Fragments {self._caption()}>"

    def _repr_html_(self) -> str:
        counts = self.counts.reshape(self.height, self.width)
        return figures.counts_figure(counts, int(counts.max(initial=0)), self._caption())

    def _caption(self) -> str:
        mean = self.total / max(self.pixels, 1)
        fragments = counted(self.total, "fragments")
        return f"{self.width}x{self.height}, {fragments}, {mean:.2f} per pixel, at most {self.counts.max(initial=0)}"


class Allocations(list[Allocation]):
    """Allocations of one view, one for each budget, that show themselves.

    Args:
        found: The allocations.
        shape: Rows and columns of the view.
    """

    def __init__(self, found: Iterable[Allocation], shape: tuple[int, int]) -> None:
        super().__init__(found)
        self.shape = shape

    def _repr_html_(self) -> str:
        rows = [
            (f"{one.budget:,}", f"{one.used:,}", number(one.error), one.bound and number(one.bound), one.proven)
            for one in self
        ]
        most = max((int(one.k.max(initial=0)) for one in self), default=0)
        maps = (
            figures.counts_figure(
                one.k.reshape(self.shape), most, f"{one.rule}, k at {counted(one.budget, 'fragments')}"
            )
            for one in self
        )
        return shown.table(("budget", "used", "squared error", "lower bound", "proven"), rows) + "".join(maps)


def _shown(
    run: Callable[Concatenate[FragmentDump | Mapping[str, ArrayLike], P], list[Allocation]],
) -> Callable[Concatenate[FragmentDump | Mapping[str, ArrayLike], P], Allocations]:
    """`labeller.allocate`, whose answer knows the shape of the view."""

    @wraps(run)
    def allocate(
        fragments: FragmentDump | Mapping[str, ArrayLike], /, *args: P.args, **kwargs: P.kwargs
    ) -> Allocations:
        dump = fragments if isinstance(fragments, FragmentDump) else fragments_of(fragments)
        return Allocations(run(dump, *args, **kwargs), (dump.height, dump.width))

    return allocate


allocate = _shown(labeller.allocate)
