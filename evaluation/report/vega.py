"""Vega-Lite: what all charts share, how a page shows a specification, and its picture where no script may run.

A chart is made by a plain function that returns a specification with its data in it (`fronts`, `lines`, `dots`). A
page shows it with `figure` and has `scripts` once; a file or an e-mail takes `svg` or `png`. Colours are those of
`evaluation.looks` on a light page; a dark page replaces each by its counterpart.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any, Final, Literal

from markupsafe import Markup, escape

from evaluation import looks
from evaluation.report.labels import HEIGHT, Span

Spec = dict[str, Any]
"""A specification of Vega-Lite, as JSON."""
Theme = Literal["light", "dark"]

SCHEMA: Final = "https://vega.github.io/schema/vega-lite/v6.json"
FOLDER: Final = Path(__file__).resolve().parent.parent / "templates" / "vega"
RUNTIME: Final = ("vega.min.js", "vega-lite.min.js", "vega-interpreter.js")
"""Vega as released (LICENSE.txt), with the interpreter, by which a page needs no `unsafe-eval`; in their order."""
DRAWING: Final = "charts.js"
"""Draws the charts of a page; needs `RUNTIME`."""
NUMBER: Final = "format(datum.value, abs(datum.value) < 1e5 ? '~g' : '~s')"
"""A number at an axis, as an expression of Vega."""
_RELEASE: Final = "6.4"
_WIDTH: Final = 600
_FONT: Final = 'system-ui, "DejaVu Sans", sans-serif'
_TITLES: Final = {"titleColor": looks.INK, "titleFont": _FONT, "titleFontSize": 12, "titleFontWeight": "normal"}
_LABELS: Final = {"labelColor": looks.SOFT, "labelFont": _FONT, "labelFontSize": 12}
_COLUMNS: Final = "max(1, floor(((containerSize()[0] || width + 70) - 70) / 240))"
"""Of a legend: as many as its place has room for, beside an axis. The plot's own width changes while it is fitted, and
a legend that followed it would be cut off after each change of the window."""
_CONFIG: Final[Spec] = {
    "background": looks.PAGE,
    "font": _FONT,
    "view": {"stroke": None},
    "axis": {
        **_TITLES,
        **_LABELS,
        "gridColor": looks.GRID,
        "domainColor": looks.INK,
        "ticks": False,
        "labelPadding": 6,
    },
    "legend": {
        **_TITLES,
        **_LABELS,
        "labelColor": looks.INK,
        "labelLimit": 320,
        "orient": "bottom",
        "direction": "horizontal",
        "columns": {"expr": _COLUMNS},
        "symbolSize": 90,
        "title": None,
    },
    "text": {"font": _FONT, "fontSize": 11, "color": looks.INK},
    "title": {"color": looks.INK, "font": _FONT, "fontSize": 14, "anchor": "start"},
}


def chart(description: str, layers: Sequence[Spec], values: Sequence[Mapping[str, Any]], **more: Any) -> Spec:
    """A specification of layers over the same data, as wide as its place.

    Args:
        description: What a screen reader says.
        layers: Marks and encodings.
        values: Rows of the data. `said` of a row is what its mark says when it is pointed at.
        more: Further members of the specification.
    """
    return {
        "$schema": SCHEMA,
        "description": description,
        "width": "container",
        "height": HEIGHT,
        "autosize": {"type": "fit-x", "contains": "padding"},
        "data": {"values": [dict(row) for row in values]},
        "layer": list(layers),
        "config": _CONFIG,
        "usermeta": {"dark": dict(looks.DARK)},
        **more,
    }


def marks(kind: Spec, encoding: Spec, **more: Any) -> Spec:
    """A layer of marks with a value each: they are pointed at, and reached with the keyboard."""
    said = {"field": "said", "type": "nominal"}
    return {"name": "marks", "mark": kind, "encoding": {**encoding, "tooltip": said, "description": said}, **more}


def axis(field: str, title: str, span: Span, **how: Any) -> Spec:
    """Encoding of a quantitative axis that shows a span, with round ticks."""
    ticks = log_ticks(span.low, span.high) if span.is_log else linear_ticks(span.low, span.high)
    scale: Spec = {"type": "log"} if span.is_log else {"type": "linear", "zero": False}
    return {
        "field": field,
        "type": "quantitative",
        "title": title,
        "scale": {**scale, "domain": [span.low, span.high], "nice": False},
        "axis": {"values": ticks, "labelExpr": NUMBER, "labelOverlap": True, **how},
    }


def themed(spec: Spec, theme: Theme) -> Spec:
    """The specification in the colours of a page."""
    if theme == "light":
        return spec
    dark = spec["usermeta"]["dark"]
    made: Spec = json.loads(json.dumps(spec), object_hook=lambda of: {k: _replaced(v, dark) for k, v in of.items()})
    return made


def _replaced(value: Any, colours: Mapping[str, str]) -> Any:
    if isinstance(value, list):
        return [_replaced(one, colours) for one in value]
    return colours.get(value, value) if isinstance(value, str) else value


def figure(spec: Spec | None, caption: str = "") -> Markup:
    """A chart in a page; nothing where there is none."""
    if spec is None:
        return Markup("")
    label = escape(spec["description"])
    # A block of data and no script: a policy against inline scripts lets it be.
    text = Markup(json.dumps(spec, separators=(",", ":")).replace("<", "\\u003c"))
    said = Markup("<figcaption>{}</figcaption>").format(caption) if caption else ""
    return Markup(
        '<figure><div class="chart" data-label="{}"><script type="application/json">{}</script>'
        "<noscript>This chart is drawn by a script.</noscript></div>{}</figure>"
    ).format(label, text, said)


@cache
def scripts() -> Markup:
    """What a page that stands by itself needs to draw its charts; nothing is fetched."""
    sources = [(FOLDER / name).read_text(encoding="utf-8") for name in (*RUNTIME, DRAWING)]
    return Markup("\n").join(Markup(f"<script>{source}</script>") for source in sources)


def svg(spec: Spec, width: int = _WIDTH, theme: Theme = "light") -> str:
    """The picture of a chart as an SVG document.

    Args:
        spec: The specification.
        width: Width in pixels.
        theme: Of the page that it will stand in.
    """
    # It brings an engine of its own, which only who draws pictures shall pay for.
    import vl_convert

    made: str = vl_convert.vegalite_to_svg(_sized(spec, width, theme), vl_version=_RELEASE, allowed_base_urls=[])
    return made + "\n"


def png(spec: Spec, width: int = _WIDTH, theme: Theme = "light", scale: float = 2.0) -> bytes:
    """The picture of a chart as a PNG file, `scale` pixels a unit; see `svg`."""
    import vl_convert

    made: bytes = vl_convert.vegalite_to_png(
        _sized(spec, width, theme), vl_version=_RELEASE, scale=scale, allowed_base_urls=[]
    )
    return made


def _sized(spec: Spec, width: int, theme: Theme) -> Spec:
    return {**themed(spec, theme), "width": width}


def log_ticks(low: float, high: float) -> list[float]:
    """Powers of ten within the range, with round values between them where there is room; at most eight ticks."""
    decades = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    for steps in ((1, 1.5, 2, 3, 4, 5, 6, 8), (1, 2, 3, 5), (1, 2, 5), (1, 3), (1,)):
        ticks = [s * 10.0**d for d in decades for s in steps if low <= s * 10.0**d * (1 + 1e-9) <= high * (1 + 2e-9)]
        if len(ticks) <= 8:
            return ticks
    stride = math.ceil(len(ticks) / 8)
    return ticks[::stride]


def linear_ticks(low: float, high: float) -> list[float]:
    """About five round values within the range."""
    step = 10.0 ** math.floor(math.log10((high - low) / 5.0))
    step *= next(s for s in (1.0, 2.0, 5.0, 10.0) if (high - low) / (step * s) <= 6.0)
    return [i * step for i in range(math.ceil(low / step), math.floor(high / step) + 1)]
