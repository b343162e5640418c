"""Error curves spelled out by hand, with a dump that has their counts."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from labeller.curves import Curves
from schemas.fragments import FragmentDump
from support.dumps import dump_of


def curves_of(errors: Sequence[Sequence[float]]) -> Curves:
    """Curves with e_p(k) = errors[p][k]; each sequence ends with 0."""
    offsets = np.concatenate([[0], np.cumsum([len(e) for e in errors])]).astype(np.int64)
    return Curves(offsets, np.concatenate([np.asarray(e, np.float32) for e in errors]), "density", 0.75, "display")


def dump_for(curves: Curves) -> FragmentDump:
    """A dump of grey fragments with the counts of the curves."""
    return dump_of([(np.full((n, 4), 128, np.uint8), np.arange(1, n + 1, dtype=np.float32)) for n in curves.counts])


def split(curves: Curves) -> list[NDArray[np.float32]]:
    """The curves of the single pixels."""
    return np.split(curves.error, curves.offsets[1:-1])
