"""One chart of each kind, and how pages hold them."""

from __future__ import annotations

import re

from evaluation.looks import LOOKS
from evaluation.report.dots import Dot, error_dots
from evaluation.report.fronts import Point, error_chart
from evaluation.report.lines import curve_chart, history_chart, log_log, loss_chart
from evaluation.report.vega import Spec

DATA = re.compile(r"<script type=\"application/json\">[^<]*</script>")
"""What a chart shows: a block of data, which no browser runs."""
POINTS = [Point("kbuffer", 1.0, 4.0, 1e-4), Point("kbuffer", 2.0, 6.0, 2e-5), Point("sbuffer", None, 9.0, 0.0)]
ALL = [Point(name, None, 1.0 + i, 1e-6 * 2**i) for i, name in enumerate(LOOKS)]
"""Every technique: a legend of many rows."""
_MADE: dict[str, Spec | None] = {
    "error": error_chart(POINTS, "</script><b> & bottles"),
    "all": error_chart(ALL, "every technique"),
    "dots": error_dots([Dot("a", "kbuffer", 1e-4), Dot("a", "kbuffer-importance", 1e-5)], "dots"),
    "history": history_chart({"a": [1e-4, 2e-4]}, ["1", "2"], {("a", 1)}, "history"),
    "curve": curve_chart([3e-5, 1e-5, 0.0], [0, 1, 2], {1: ["A"]}, "curve"),
    "lines": log_log("t", ("x", "y"), {"a": [(1.0, 2.0), (10.0, 30.0)]}),
    "loss": loss_chart([(0, 1.0), (1, 0.5), (2, 0.4)]),
}
CHARTS = {name: spec for name, spec in _MADE.items() if spec is not None}
