"""A new version against the champion on the committed held-out scenes: the verdict, and the table for a pull request.

Rules:
- the check passes only if something was compared: a missing number is never a good one;
- the mean over the held-out scenes and every single one of them may be worse by the threshold and no more.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from diaphane.cli.lines import plain
from evaluation.summary import number


@dataclass(frozen=True, slots=True)
class Row:
    """A held-out scene.

    Attributes:
        scene: Its label; None for all of them together.
        score: Squared error of the new version over VKB's, geometric mean over views and budgets; None: not compared.
        rival: The same of the champion.
    """

    scene: str | None
    score: float | None
    rival: float | None

    @property
    def title(self) -> str:
        """What it is called in Markdown."""
        return "all held-out scenes" if self.scene is None else code(self.scene)

    @property
    def change(self) -> float | None:
        """How much larger the error is than the champion's, as a fraction; None where one of them is missing."""
        return None if self.score is None or self.rival is None else self.score / self.rival - 1.0


@dataclass(frozen=True, slots=True)
class Comparison:
    """What a job's result says.

    Attributes:
        reference: The new version.
        champion: Version that it was compared with; None if there was none, or nothing was to be compared.
        is_champion: Whether the new version is the champion itself: its files are the same.
        total: Of all held-out scenes together.
        rows: One for each held-out scene that was measured.
        expected: How many held-out scenes were asked for.
        reason: What the registry says.
        notes: What else a reviewer should know, Markdown, one line each.
    """

    reference: str
    champion: str | None
    is_champion: bool
    total: Row
    rows: tuple[Row, ...]
    expected: int
    reason: str = ""
    notes: tuple[str, ...] = field(default=())

    def faults(self, threshold: float) -> list[str]:
        """Why the check does not pass, a sentence each; none if it passes.

        Args:
            threshold: Largest fraction by which an error may be larger than the champion's.
        """
        if self.total.score is None:
            return ["Nothing on the held-out scenes could be compared: use smaller budgets, or other scenes."]
        faults = []
        if len(self.rows) < self.expected:
            faults.append(f"Only {len(self.rows)} of {self.expected} held-out scenes could be measured.")
        if self.champion is None or self.is_champion:
            return faults
        if self.total.rival is None:
            return [*faults, f"It could not be compared with the champion {self.champion}. {self.reason}".strip()]
        for row in (self.total, *self.rows):
            if row.rival is not None and row.change is None:
                faults.append(f"{row.title} could not be measured, and could be with the champion.")
            elif row.change is not None and row.change > threshold:
                faults.append(f"The error on {row.title} is {_percent(row.change)} against the champion's.")
        return faults

    @property
    def is_better(self) -> bool:
        """Whether it may become the champion: it is the first, or its error is smaller."""
        if self.total.score is None or self.is_champion:
            return False
        return self.champion is None or (self.total.change is not None and self.total.change < 0.0)

    def markdown(self, threshold: float) -> str:
        """The table and the verdict."""
        faults = self.faults(threshold)
        against = f" against the champion `{self.champion}`" if self.champion else ""
        lines = [
            f"### {'❌' if faults else '✅'} Diaphane: `{self.reference}`{against}",
            "",
            "Squared error over that of VKB (geometric mean over views and budgets), held-out scenes; lower is better.",
            "",
            "| scene | champion | this version | change |",
            "|---|---:|---:|---:|",
            *(_line(row) for row in self.rows),
            _line(self.total),
            "",
        ]
        lines += [f"- {fault}" for fault in faults] or [self._praise(threshold)]
        lines += [f"- {note}" for note in self.notes]
        return "\n".join(lines) + "\n"

    def _praise(self, threshold: float) -> str:
        if self.is_champion:
            return "- Nothing changed: these files are the champion's."
        if self.champion is None:
            return "- There is no champion that it could be compared with."
        return f"- No held-out scene is worse by more than {100.0 * threshold:g} %."


def comparison_of(
    job: Mapping[str, Any], champion: str | None, expected: int, notes: tuple[str, ...] = ()
) -> Comparison:
    """What the result of a finished build says.

    Args:
        job: The job, as the server answers it.
        champion: Version that was the champion when it was submitted; None: nothing is to be compared.
        expected: How many scenes were held out.
        notes: See `Comparison`.
    """
    result = job["result"] or {}
    per_scene = result.get("per_scene") or {}
    return Comparison(
        reference=plain(result.get("reference", "none")),
        champion=champion,
        is_champion=result.get("champion") is True and result.get("rival_score") is None and champion is not None,
        total=Row(None, _positive(result.get("score")), _positive(result.get("rival_score"))),
        rows=tuple(
            Row(plain(label), _positive(entry.get("score")), _positive(entry.get("rival")))
            for label, entry in sorted(per_scene.items())
        ),
        expected=expected,
        reason=plain(result.get("reason", "")),
        notes=notes,
    )


def code(text: str) -> str:
    """Text of somebody else as a code span, in a table too: no link, picture, HTML, cell or mention comes of it."""
    return "`" + plain(text).replace("`", "'").replace("|", "\\|") + "`"


def _line(row: Row) -> str:
    change = "–" if row.change is None else _percent(row.change)
    return f"| {row.title} | {number(row.rival)} | {number(row.score)} | {change} |"


def _percent(change: float) -> str:
    return f"{100.0 * change:+.1f} %".replace("-", "−")


def _positive(value: Any) -> float | None:
    return float(value) if isinstance(value, int | float) and math.isfinite(value) and value > 0.0 else None
