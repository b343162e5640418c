"""What cannot be measured is refused before any work starts, with what to do instead."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from evaluation.bench.options import BenchOptions, parse_alphas, parse_budgets, parse_sizes, parse_tails
from renderer.techniques import Needs
from schemas.flags import checked
from schemas.problem import ExitCode, Problem
from schemas.work import Device


@pytest.fixture
def options(tmp_path: Path) -> BenchOptions:
    (tmp_path / "scene.usda").touch()
    return BenchOptions((tmp_path / "scene.usda",), ("sbuffer", "kbuffer"), tmp_path / "out")


@pytest.mark.parametrize(
    ("change", "title"),
    [
        ({"scenes": (Path("missing.usda"),)}, "There is no scene missing.usda."),
        ({"budgets": (0.0,)}, "A budget of 0 cannot be used."),
        ({"budgets": (float("nan"),)}, "A budget of nan cannot be used."),
        ({"budgets": ()}, "0 budgets are not possible."),
        (
            {"budgets": (1e-3, 1.0), "sizes": ((64, 48), (31, 32))},
            "A budget of 0.001 is less than one fragment of a picture of 31x32 pixels.",
        ),
        ({"sizes": ((320, 200), (16000, 16000))}, "--size 16000x16000 is too large."),
        ({"bundle": ""}, "--bundle is empty."),
        (
            {"techniques": ("multilayer", "adaptive"), "needs": Needs(nodes=1)},
            "adaptive cannot work with 1 nodes per pixel.",
        ),
        (
            {"techniques": ("stochastic",), "needs": Needs(samples=0)},
            "stochastic cannot work with 0 samples a pixel.",
        ),
        ({"sizes": ((15, 100),)}, "15 pixels are no side of a picture here."),
        ({"g": -1.0}, "--g -1 is not between 0 and 10."),
        (
            {"g": 0.5, "bundle": "glass"},
            "--g 0.5 is the steepness of a tail, and none is named: the bundle brings its own, with its own g.",
        ),
        ({"repeats": 0}, "--repeats 0 cannot be used."),
        ({"most_views": 0}, "--most-views 0 cannot be used."),
        ({"path": 1}, "--path 1 cannot be used."),
        ({"limit": 0.0}, "--limit 0.0 is no time."),
        ({"techniques": ("kbuffer-deep",)}, "kbuffer-deep needs a bundle."),
        ({"techniques": ("kbuffer-temporal",)}, "kbuffer-temporal needs a bundle."),
    ],
)
def test_options_that_cannot_be_are_problems(options: BenchOptions, change: dict[str, Any], title: str) -> None:
    with pytest.raises(Problem) as problem:
        replace(options, **change)
    assert problem.value.title == title
    assert problem.value.remedy


def test_scenes_of_one_name_cannot_be_told_apart(options: BenchOptions, tmp_path: Path) -> None:
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "scene.usdc").touch()
    with pytest.raises(Problem, match="2 scenes are called scene"):
        replace(options, scenes=(*options.scenes, tmp_path / "other" / "scene.usdc"))


@pytest.mark.parametrize("field", ["bandwidth", "fill_rate"])
@pytest.mark.parametrize("value", [0.0, float("nan"), float("inf")])
def test_bounds_are_stated_for_a_device_that_can_be(field: str, value: float) -> None:
    with pytest.raises(Problem, match=f"--{field.replace('_', '-')} {value:g} is not above 0"):
        checked(Device, {field: value})


def test_lists_are_read_in_order_and_once() -> None:
    assert parse_budgets("4, 1,2,1") == (1.0, 2.0, 4.0)
    assert parse_alphas(".33,authored,.15,.33") == (0.33, None, 0.15)
    assert parse_alphas(None) == (None,)
    assert parse_sizes("1430x960,320x214") == ((1430, 960), (320, 214))
    assert parse_tails("paper,density") == ("paper", "density")


@pytest.mark.parametrize(
    ("parse", "text"),
    [
        (parse_budgets, "1,two"),
        (parse_budgets, ","),
        (parse_alphas, "1.5"),
        (parse_alphas, "0"),
        (parse_alphas, "glass"),
        (parse_sizes, "1430"),
        (parse_tails, "fuzzy"),
    ],
)
def test_lists_with_anything_else_are_problems(parse: Any, text: str) -> None:
    with pytest.raises(Problem) as problem:
        parse(text)
    assert problem.value.code == ExitCode.USAGE
    assert "--" in problem.value.remedy or "number" in problem.value.remedy
