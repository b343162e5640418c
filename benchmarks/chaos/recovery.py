"""How long it took until what was killed was made good, by what it was."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from benchmarks.chaos.storm import Kill


def recovery(kills: Sequence[Kill]) -> dict[str, dict[str, float]]:
    """Count, p50, p95 and the longest, seconds; of all, and by what was hit. Whoever did nothing counts in none."""
    kinds = {"all": list(kills)} | {what: [k for k in kills if k.what == what] for what in sorted(counts(kills))}
    found = {}
    for what, group in kinds.items():
        seconds = sorted(kill.seconds for kill in group if kill.seconds is not None and kill.doing != "idle")
        if seconds:
            shares = {"p50": quantile(seconds, 0.5), "p95": quantile(seconds, 0.95), "max": seconds[-1]}
            found[what] = {"count": len(seconds), **{name: round(value, 2) for name, value in shares.items()}}
    return found


def counts(kills: Sequence[Kill]) -> dict[str, int]:
    """How often what was hit."""
    return dict(sorted(Counter(kill.what for kill in kills).items()))


def quantile(ordered: Sequence[float], share: float) -> float:
    """The smallest of rising values that at least this share of them do not exceed."""
    return ordered[max(0, -(-len(ordered) * int(100 * share) // 100) - 1)]
