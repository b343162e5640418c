"""DHOIT's Figure 6 as SVG: squared error of every technique within a budget, scene by scene, on a logarithmic axis."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from html import escape

from services.bench.groups import ORACLE_WORDS, Group, measured, offline, said_technique
from services.report.charts import log_ticks
from services.summary import number

PALETTE = ("#6b7280", "#c98a1b", "#c8322b", "#0b62b0", "#0c8457", "#7b3fa0", "#17a2a2", "#a0522d")
_STANDALONE = (
    "text{font:11px system-ui,sans-serif;fill:#808080}.grid{stroke:#808080;stroke-opacity:.25;fill:none}"
    ".axis{stroke:#808080;fill:none}"
)
_LETTER, _MOST_LETTERS = 6.4, 16
"""Width of a letter, and how many of a line under a cluster are shown."""
_BAR, _GAP, _LEFT, _TOP, _PLOT, _BOTTOM = 10.0, 22.0, 62.0, 34.0, 220.0, 62.0


def error_bars(groups: Sequence[Group], factor: float, standalone: bool = False) -> str:
    """Bars of the bounded techniques at one budget; '' where there are none.

    Args:
        groups: One cluster of bars each.
        factor: F / WH.
        standalone: Whether it is a file of its own, with its own style.
    """
    shown = [(group, bars) for group in groups if (bars := _errors(group, factor))]
    errors = [error for _, bars in shown for error in bars.values()]
    if not errors:
        return ""
    names = list(dict.fromkeys(name for _, bars in shown for name in bars))
    low, high = min(errors) / 1.5, max(errors) * 1.5
    lines = [line for group, _ in shown for line in _lines(group)]
    cluster = max(_BAR * len(names) + _GAP, _LETTER * max(map(len, lines)) + 6.0)
    width = max(_LEFT + cluster * len(shown), _LEFT + sum(map(_legend_width, names))) + 10.0
    height = _TOP + _PLOT + _BOTTOM
    parts = [_axes(low, high, width)]
    for place, (group, bars) in enumerate(shown):
        parts.append(_cluster(group, bars, names, (low, high), _LEFT + (place + 0.5) * cluster))
    parts.append(_legend(names))
    style = f"<style>{_STANDALONE}</style>" if standalone else ""
    label = escape(f"Squared error within F = {factor:g} WH, by scene and technique")
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" class="bars" width="{width:.0f}" '
        f'viewBox="0 0 {width:.0f} {height:.0f}" role="img" '
        f'aria-label="{label}">{style}{"".join(parts)}</svg>'
    )


def _errors(group: Group, factor: float) -> dict[str, float]:
    """Name -> squared error x1e5 of the bounded techniques, and of DHOIT's oracle."""
    rows = [row for row in measured(group.rows, "fragments") if row.key.budget_factor == factor]
    errors = {said_technique(row.key): 1e5 * row.mse for row in rows if row.mse is not None}
    for mark in offline(group):
        if mark.budget_factor == factor and mark.gap is None:
            errors[ORACLE_WORDS] = 1e5 * mark.mse
    return errors


def _axes(low: float, high: float, width: float) -> str:
    parts = []
    for value in log_ticks(low, high):
        y = _y(value, (low, high))
        parts.append(f'<path class="grid" d="M{_LEFT} {y:.1f}H{width - 10:.0f}"/>')
        parts.append(f'<text class="tick" text-anchor="end" x="{_LEFT - 6}" y="{y + 4:.1f}">{value:g}</text>')
    parts.append(f'<path class="axis" d="M{_LEFT} {_TOP}V{_TOP + _PLOT}H{width - 10:.0f}"/>')
    middle = _TOP + 0.5 * _PLOT
    parts.append(
        f'<text class="label" text-anchor="middle" transform="translate(14 {middle}) rotate(-90)">MSE ×1e-5</text>'
    )
    return "".join(parts)


def _cluster(
    group: Group, bars: Mapping[str, float], names: Sequence[str], span: tuple[float, float], middle: float
) -> str:
    parts = []
    for name, error in bars.items():
        x, y = middle + _BAR * (names.index(name) - 0.5 * len(names)), _y(error, span)
        parts.append(
            f'<rect x="{x:.1f}" y="{y:.1f}" width="{_BAR - 1}" height="{_TOP + _PLOT - y:.1f}" '
            f"{_fill(names, name)}>"
            f"<title>{escape(f'{group.title}, {name}: {number(error)}e-5')}</title></rect>"
        )
    for line, text in enumerate(_lines(group)):
        y = _TOP + _PLOT + 15 + 13 * line
        parts.append(f'<text class="tick" text-anchor="middle" x="{middle:.1f}" y="{y}">{escape(text)}</text>')
    return "".join(parts)


def _lines(group: Group) -> list[str]:
    return [line[:_MOST_LETTERS] for line in group.title.split(", ")]


def _legend(names: Sequence[str]) -> str:
    parts, x = [], _LEFT
    for name in names:
        parts.append(f'<rect x="{x:.0f}" y="8" width="10" height="10" {_fill(names, name)}/>')
        parts.append(f'<text class="tick" x="{x + 14:.0f}" y="17">{escape(name)}</text>')
        x += _legend_width(name)
    return "".join(parts)


def _legend_width(name: str) -> float:
    return 26.0 + _LETTER * len(name)


def _y(value: float, span: tuple[float, float]) -> float:
    low, high = span
    share = math.log(value / low) / math.log(high / low)
    return _TOP + _PLOT * (1.0 - share)


def _fill(names: Sequence[str], name: str) -> str:
    """A colour of its own: the palette, then the palette in paler."""
    times, colour = divmod(names.index(name), len(PALETTE))
    paler = f' fill-opacity="{0.5**times:g}"' if times else ""
    return f'fill="{PALETTE[colour]}"{paler}'
