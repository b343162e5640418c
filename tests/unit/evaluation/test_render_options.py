"""What can be asked of `diaphane render`."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from evaluation.render_options import (
    RenderOptions,
    parse_background,
    parse_needs,
    parse_refine,
    parse_techniques,
    parse_times,
    parse_vkb,
    said_left_out,
)
from renderer.allocation.importance import VkbOptions
from renderer.techniques import TECHNIQUES
from schemas.problem import ExitCode, Problem


def test_techniques_come_by_name_in_lists_or_all() -> None:
    assert parse_techniques((), False) == ("sbuffer",)
    assert parse_techniques(("kbuffer, sbuffer", "kbuffer"), False) == ("kbuffer", "sbuffer")
    assert set(parse_techniques(("all",), False)) == set(TECHNIQUES) - {"kbuffer-deep", "kbuffer-temporal"}
    assert set(parse_techniques(("all",), True)) == set(TECHNIQUES)
    with pytest.raises(Problem) as caught:
        parse_techniques(("zbuffer",), False)
    assert caught.value.code == ExitCode.NOT_FOUND


@pytest.mark.parametrize("names", [("",), (",",), ("", " ")])
def test_a_technique_without_a_name_is_refused(names: tuple[str, ...]) -> None:
    with pytest.raises(Problem, match="No technique is named"):
        parse_techniques(names, False)


def test_all_says_what_it_leaves_out_without_a_bundle() -> None:
    for names in (["all"], ["kbuffer,all"], ["kbuffer, all"]):
        said = said_left_out(names, has_bundle=False) or ""
        for name in set(TECHNIQUES) - set(parse_techniques(names, has_bundle=False)):
            assert name in said
        assert said_left_out(names, has_bundle=True) is None
    assert said_left_out(["kbuffer"], has_bundle=False) is None


def test_complexity_is_levels_of_refinement() -> None:
    assert [parse_refine(word, None) for word in ("low", "medium", "high", "veryhigh")] == [0, 1, 2, 3]
    assert (parse_refine(None, None), parse_refine(None, 5)) == (0, 5)
    for complexity, refine in (("high", 2), ("ultra", None)):
        with pytest.raises(Problem):
            parse_refine(complexity, refine)


def test_the_default_time_is_not_a_number() -> None:
    assert parse_times(None, False) == ()
    assert parse_times("1:3", False) == (1.0, 2.0, 3.0)
    assert [math.isnan(time) for time in parse_times(None, True)] == [True]
    with pytest.raises(Problem, match="Both"):
        parse_times("1", True)


@pytest.mark.parametrize(
    ("text", "linear"),
    [("#ffffff", (1, 1, 1)), ("#000000", (0, 0, 0)), ("#BC0000", (0.5028865, 0, 0)), ("0.25,0.5,1", (0.25, 0.5, 1))],
)
def test_colours_of_a_screen_and_linear_ones(text: str, linear: tuple[float, ...]) -> None:
    np.testing.assert_allclose(parse_background(text), linear, atol=1e-6)


@pytest.mark.parametrize("text", ["", "white", "#fff", "1,2,3", "1,1", "nan,0,0", "-1,0,0"])
def test_what_is_no_colour_is_refused(text: str) -> None:
    with pytest.raises(Problem, match="not a colour"):
        parse_background(text)


def test_every_factor_of_vkb_can_be_switched_off() -> None:
    assert parse_vkb("") == VkbOptions()
    assert parse_vkb("no-fresnel, no-noise") == VkbOptions(fresnel=False, noise=0.0)
    assert parse_vkb("no-depth,no-periphery") == VkbOptions(depth=False, periphery=False)
    assert parse_vkb("thesis,no-noise") == VkbOptions(fresnel=False, reach=2.0, noise=0.0)
    for text in ("fresnel", "no-colour", "no-floor", "no-thesis"):
        with pytest.raises(Problem, match="not a switch"):
            parse_vkb(text)


def test_inference_is_one_of_those_there_are() -> None:
    needs = parse_needs("no-noise", "onnx", 3, 16)
    assert (needs.vkb.noise, needs.inference, needs.nodes, needs.samples) == (0.0, "onnx", 3, 16)
    with pytest.raises(Problem, match="no inference"):
        parse_needs("", "torch", None, None)


@pytest.mark.parametrize(
    "wrong",
    [
        {"budget": 0.0},
        {"budget": math.nan},
        {"budget": 1e-9, "size": (320, 200)},
        {"bundle": ""},
        {"g": -1.0},
        {"g": 0.5, "bundle": "glass"},
        {"image_width": 0},
        {"size": (10, 100_000)},
        {"size": (0, 0)},
        {"output": Path("a.jpg")},
        {"output": Path("a.png"), "frames": (1.0, 2.0)},
    ],
)
def test_what_cannot_be_rendered_is_refused_at_once(wrong: dict[str, object]) -> None:
    with pytest.raises(Problem):
        RenderOptions(scenes=(Path("a.usda"),), **wrong)  # type: ignore[arg-type]
