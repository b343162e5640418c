"""The techniques of a comparison in the order of their errors."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

from evaluation.rendering import Picture
from renderer import metrics


@dataclass(frozen=True, slots=True)
class Rank:
    """A technique over all pictures that it was asked for. Means are over those that it rendered.

    Attributes:
        technique: Name.
        family: `exact`, `bounded` or `approximate`.
        rendered: Pictures that it rendered.
        asked: Pictures that it was asked for.
        mse: Mean over pictures, 8-bit sRGB, values in [0,1]; None: it rendered none.
        psnr: dB, of that mean; None also for no error.
        flip: Mean over pictures.
        milliseconds: Mean over pictures.
        total_bytes: Of the picture with most.
    """

    technique: str
    family: str
    rendered: int
    asked: int
    mse: float | None
    psnr: float | None
    flip: float | None
    milliseconds: float | None
    total_bytes: int | None

    def json(self) -> dict[str, Any]:
        """Of plain values only."""
        return asdict(self)


def ranked(pictures: Sequence[Picture]) -> list[Rank]:
    """Techniques by mean squared error, then by time; one that lacks pictures comes behind all that have them.

    Args:
        pictures: Of a comparison, of any number of views.
    """
    names = dict.fromkeys(picture.technique for picture in pictures)
    ranks = [_rank([picture for picture in pictures if picture.technique == name]) for name in names]
    return sorted(ranks, key=_order)


def _order(rank: Rank) -> tuple[int, float, float]:
    missing = rank.asked - rank.rendered
    return missing, math.inf if rank.mse is None else rank.mse, rank.milliseconds or 0.0


def _rank(pictures: Sequence[Picture]) -> Rank:
    done = [picture for picture in pictures if picture.mse is not None]
    mse = _mean([picture.mse for picture in done if picture.mse is not None])
    return Rank(
        technique=pictures[0].technique,
        family=pictures[0].family,
        rendered=len(done),
        asked=len(pictures),
        mse=mse,
        psnr=None if not mse else metrics.psnr(mse),
        flip=_mean([picture.flip for picture in done if picture.flip is not None]),
        milliseconds=_mean([picture.milliseconds for picture in done if picture.milliseconds is not None]),
        total_bytes=max((picture.total_bytes for picture in done if picture.total_bytes is not None), default=None),
    )


def _mean(values: Sequence[float]) -> float | None:
    return math.fsum(values) / len(values) if values else None
