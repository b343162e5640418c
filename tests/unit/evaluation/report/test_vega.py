"""Vega-Lite: a picture of every chart where no script may run, in the colours of both themes."""

from __future__ import annotations

import io
import json
import re
from itertools import combinations
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image
from support.charts import CHARTS

from evaluation.looks import DARK, DARK_PAGE, LOOKS, PAGE
from evaluation.report.vega import FOLDER, Spec, figure, linear_ticks, log_ticks, png, scripts, svg, themed
from renderer.techniques import TECHNIQUES


@given(st.floats(1e-6, 1e6), st.floats(1.1, 1e9))
def test_log_ticks_are_few_ascending_and_inside(low: float, ratio: float) -> None:
    high = low * ratio
    ticks = log_ticks(low, high)
    assert len(ticks) <= 8
    assert ticks == sorted(set(ticks))
    assert all(low * (1 - 1e-6) <= tick <= high * (1 + 1e-6) for tick in ticks)


@pytest.mark.parametrize(
    ("low", "high", "ticks"),
    [(290, 810, "300 400 500 600 800"), (0.03, 30, "0.03 0.1 0.3 1 3 10 30"), (1, 100, "1 2 5 10 20 50 100")],
)
def test_log_ticks_are_round(low: float, high: float, ticks: str) -> None:
    assert " ".join(f"{tick:g}" for tick in log_ticks(low, high)) == ticks


@given(st.floats(-1e3, 1e3), st.floats(1e-3, 1e4))
def test_linear_ticks_are_few_and_inside(low: float, span: float) -> None:
    ticks = linear_ticks(low, low + span)
    assert 2 <= len(ticks) <= 7
    assert all(low - 1e-6 * span <= tick <= low + span * (1 + 1e-6) for tick in ticks)


def _seen(spec: Spec, theme: Any) -> np.ndarray[Any, Any]:
    return np.asarray(Image.open(io.BytesIO(png(spec, 390, theme, scale=1.0))).convert("RGB"))


@pytest.mark.parametrize("name", CHARTS)
def test_a_picture_shows_the_chart_in_the_colours_of_its_page(name: str) -> None:
    spec = CHARTS[name]
    light, dark = _seen(spec, "light"), _seen(spec, "dark")
    assert 390 <= light.shape[1] <= 900
    for seen, page in ((light, PAGE), (dark, DARK_PAGE)):
        background = tuple(bytes.fromhex(page[1:]))
        assert tuple(seen[1, -2]) == background
        assert (seen != background).any(axis=2).mean() > 0.01
    # What is drawn in one of a technique's colours is drawn in its counterpart.
    coloured = [look for look in LOOKS.values() if (light == tuple(bytes.fromhex(look.light[1:]))).all(axis=2).any()]
    assert coloured
    for look in coloured:
        assert (dark == tuple(bytes.fromhex(look.dark[1:]))).all(axis=2).any(), look.title


def test_a_document_has_a_mark_for_each_row_and_says_its_value() -> None:
    spec = CHARTS["error"]
    drawn = svg(spec)
    for row in spec["data"]["values"]:
        assert drawn.count(f'aria-label="{row["said"]}"') == 1
    assert "http" not in drawn.replace("http://www.w3.org/", "")


def test_every_technique_has_a_look_of_its_own() -> None:
    assert set(LOOKS) == set(TECHNIQUES)
    assert len({look.shape for look in LOOKS.values()}) == len(LOOKS)
    assert len({look.title for look in LOOKS.values()}) == len(LOOKS)
    assert LOOKS["kbuffer-importance"].title == "VKB (kbuffer-importance)"


def _linear(colour: str) -> np.ndarray[Any, Any]:
    values = np.frombuffer(bytes.fromhex(colour[1:]), np.uint8) / 255.0
    return np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)


def _contrast(one: str, two: str) -> float:
    light, dark = sorted((float(_linear(each) @ (0.2126, 0.7152, 0.0722)) for each in (one, two)), reverse=True)
    return (light + 0.05) / (dark + 0.05)


# Machado, Oliveira and Fernandes 2009, severity 1, of linear sRGB.
_DEFICIENCIES = {
    "none": np.eye(3),
    "protanopia": np.array(
        [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]]
    ),
    "deuteranopia": np.array(
        [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]]
    ),
    "tritanopia": np.array(
        [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]]
    ),
}
_LMS = np.array(
    [[0.41222147, 0.53633254, 0.05144599], [0.2119035, 0.6806995, 0.10739696], [0.08830246, 0.28171884, 0.6299787]]
)
_OKLAB = np.array(
    [[0.21045426, 0.79361779, -0.00407205], [1.97799849, -2.42859221, 0.4505937], [0.02590404, 0.78277177, -0.80867577]]
)


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_colours_are_seen_on_their_page_and_told_apart_by_the_colour_blind(theme: str) -> None:
    of = {name: getattr(look, theme) for name, look in LOOKS.items()}
    page = PAGE if theme == "light" else DARK_PAGE
    assert all(_contrast(colour, page) >= 3.0 for colour in of.values())
    bounded = [name for name, entry in TECHNIQUES.items() if entry.family == "bounded"]
    for name, seen in _DEFICIENCIES.items():
        labs = {each: _OKLAB @ np.cbrt(_LMS @ np.clip(seen @ _linear(of[each]), 0, 1)) for each in bounded}
        for one, two in combinations(bounded, 2):
            assert np.linalg.norm(labs[one] - labs[two]) > 0.05, f"{one}, {two}, {name}"


def test_a_theme_changes_colours_alone() -> None:
    spec = CHARTS["error"]
    light, dark = (json.dumps({**themed(spec, theme), "usermeta": None}) for theme in ("light", "dark"))
    assert light != dark
    for one, other in DARK.items():
        light = light.replace(f'"{one}"', f'"{other}"')
    assert light == dark


def test_a_figure_carries_its_specification_and_nothing_that_a_policy_forbids() -> None:
    spec = CHARTS["error"]
    text = str(figure(spec, "a < b"))
    (data,) = re.findall(r'<script type="application/json">(.*?)</script>', text)
    assert json.loads(data) == spec
    assert "a &lt; b" in text
    assert figure(None) == ""


def test_the_vendored_scripts_are_as_released() -> None:
    text = {name: (FOLDER / name).read_text(encoding="utf-8") for name in ("vega.min.js", "vega-lite.min.js")}
    assert 'version="6.4.0"' in text["vega.min.js"]
    assert '"6.4.3"' in text["vega-lite.min.js"][:600]
    assert "Interactive Data Lab" in (FOLDER / "LICENSE.txt").read_text(encoding="utf-8")
    assert "</script" not in str(scripts()).replace("</script>\n<script>", "").removesuffix("</script>")
