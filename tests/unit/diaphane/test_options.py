"""Options: what cannot work is refused before any work, with words that help."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest

from diaphane.local.options import BuildOptions, asked, default_holdout
from evaluation.choices import check_budget, check_steepness, check_trained_tail, chosen_tail, parse_glass, parse_tail
from schemas.bundle import TailSpec
from schemas.flags import given, parse_size
from schemas.options import Options
from schemas.problem import ExitCode, Problem
from schemas.tail import TailName


@pytest.fixture
def scenes(tmp_path: Path) -> tuple[Path, ...]:
    paths = tuple(tmp_path / f"{name}.usda" for name in ("bottles", "foliage", "knots", "voxels"))
    for path in paths:
        path.write_text("#usda 1.0\n")
    return paths


@pytest.mark.parametrize(
    ("tail", "g", "trained", "expected"),
    [
        (None, None, None, ("binned-12", 0.75)),
        (None, 2.0, None, ("binned-12", 2.0)),
        (None, None, ("binned-8", 0.5), ("binned-8", 0.5)),
        ("binned-8", None, ("binned-8", 0.5), ("binned-8", 0.5)),
        ("density", 2.0, ("binned-8", 0.5), ("density", 2.0)),
        ("binned-16", None, ("binned-8", 0.5), ("binned-16", 0.75)),
    ],
)
def test_a_tail_is_the_one_asked_for_else_the_bundle_s_else_the_usual_one(
    tail: TailName | None, g: float | None, trained: tuple[TailName, float] | None, expected: tuple[str, float]
) -> None:
    found = chosen_tail(tail, g, None if trained is None else TailSpec(name=trained[0], g=trained[1]))
    assert (found.name, found.g) == expected


def test_a_bundle_is_made_only_for_a_tail_with_depth_bins(scenes: tuple[Path, ...]) -> None:
    assert BuildOptions(scenes, "glass", Options(tail="density-16")).options.tail == "density-16"
    unbinned: tuple[TailName, ...] = ("density", "exact-coverage", "weighted-average", "paper")
    for tail in unbinned:
        with pytest.raises(Problem, match=f"cannot be made for the tail {tail}: it has no depth bins") as caught:
            BuildOptions(scenes, "glass", Options(tail=tail))
        assert caught.value.remedy == "Use one of binned-8, binned-12, binned-16, density-16: --tail binned-12."


def test_a_bundle_is_rendered_with_its_own_tail() -> None:
    trained = TailSpec(name="binned-12", g=0.75)
    for tail, own in ((None, trained), ("binned-12", trained), ("paper", None)):
        check_trained_tail(tail, own)  # type: ignore[arg-type]
    with pytest.raises(Problem, match="trained with the tail binned-12, and cannot be rendered with paper") as caught:
        check_trained_tail("paper", trained)
    assert caught.value.remedy == "Leave out --tail or the techniques that need a bundle."
    with pytest.raises(Problem) as caught:
        check_trained_tail("binned-8", trained)
    assert "`diaphane build --tail binned-8`" in caught.value.remedy


def test_a_steepness_beside_a_bundle_needs_the_tail_that_it_is_of() -> None:
    for has_bundle, is_tail_named in ((False, False), (False, True), (True, True)):
        check_steepness(0.5, has_bundle=has_bundle, is_tail_named=is_tail_named)
    check_steepness(None, has_bundle=True, is_tail_named=False)
    with pytest.raises(Problem, match="the bundle brings its own") as caught:
        check_steepness(0.5, has_bundle=True, is_tail_named=False)
    assert caught.value.remedy == "Leave out --g, or name the tail as well: --tail density --g 0.5."


def test_budgets_are_sorted_and_unique() -> None:
    assert asked(Options, {"budgets": (4.0, 1.0, 4.0)}).budgets == (1.0, 4.0)
    assert asked(Options, {}).budgets is None, "what is captured decides"


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"budgets": ()}, "No budget"),
        ({"budgets": (0.0,)}, "A budget of 0 "),
        ({"budgets": (1.0, -2.0)}, "A budget of -2 "),
        ({"budgets": (float("nan"),)}, "A budget of nan "),
        ({"budgets": (float("inf"),)}, "A budget of inf "),
        ({"budgets": (1e-9,)}, "A budget of 1e-09 is less than one fragment of a picture of 1430x960 pixels."),
        ({"budgets": tuple(float(i) for i in range(1, 18))}, "17 budgets are too few or too many."),
        ({"alpha": 0.0}, "--alpha 0 is not between 0 and 1 (both excluded)."),
        ({"alpha": 1.0}, "--alpha 1 is not between 0 and 1"),
        ({"alpha": float("nan")}, "--alpha nan is not between"),
        ({"width": 8}, "--size 8x960 is not 16..16384."),
        ({"width": 16000, "height": 16000}, "16000 x 16000 is more than 33177600 pixels."),
        ({"width": 100000, "height": 16}, "--size 100000x16 is not 16..16384."),
        ({"width": 0, "budgets": (1.0,)}, "--size 0x960 is not 16..16384."),
        ({"views_per_scene": 0}, "--views-per-scene 0 is not 1..1000."),
        ({"g": -1.0}, "--g -1 is not between 0 and 10."),
        ({"g": float("nan")}, "--g nan is not between 0 and 10."),
        ({"seed": -1}, "--seed -1 is not 0..2^53 - 1."),
        ({"seed": 2**53}, "--seed 9007199254740992 is not 0..2^53 - 1."),
        ({"steps": 0}, "--steps 0 is not 1..1000000."),
        ({"steps": 10**12}, "--steps 1000000000000 is not 1..1000000."),
        ({"patience": -1}, "--patience -1 is not 0..1000000."),
        ({"steps": 0, "patience": -1}, "--steps 0 is not 1..1000000. --patience -1 is not 0..1000000."),
        ({"tail": "dense"}, "There is no tail 'dense'."),
        ({"network": "huge"}, "There is no network 'huge'."),
        ({"weights": "ssim"}, "There are no weights 'ssim'."),
    ],
)
def test_options_out_of_range_are_problems(fields: dict[str, Any], words: str) -> None:
    with pytest.raises(Problem) as caught:
        asked(Options, fields)
    assert words in caught.value.title
    assert caught.value.remedy


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"start": ""}, "--from is empty."),
        ({"start": " "}, "--from is empty."),
        ({"replay": Path("datasets/glass")}, "--replay needs --from"),
        ({"name": "Glass!"}, "'Glass!' cannot be the name"),
        ({"holdout": (Path("teapot"),)}, "teapot is not among the scenes"),
        ({"views": Path("nowhere.json")}, "no views file nowhere.json"),
    ],
)
def test_builds_that_cannot_be_are_problems(change: dict[str, Any], words: str, scenes: tuple[Path, ...]) -> None:
    with pytest.raises(Problem) as caught:
        BuildOptions(**{"scenes": scenes, "name": "glass", **change})
    assert words in caught.value.title
    assert caught.value.remedy


@pytest.mark.parametrize("size", [(1430, 960), (16, 16), (1, 1), (8191, 3)])
def test_the_least_budget_that_a_problem_names_can_be_used(size: tuple[int, int]) -> None:
    with pytest.raises(Problem) as caught:
        check_budget(0.99 / (size[0] * size[1]), "--budgets 1", size)
    named = re.search(r"here (\S+) or more", caught.value.remedy)
    assert named is not None
    check_budget(float(named[1]), "--budgets 1", size)
    assert float(named[1]) * size[0] * size[1] < 1.02


def test_a_missing_scene_ends_with_not_found(scenes: tuple[Path, ...]) -> None:
    with pytest.raises(Problem, match=r"no file nowhere\.usda") as caught:
        BuildOptions((*scenes, Path("nowhere.usda")), "glass")
    assert caught.value.code == ExitCode.NOT_FOUND


def test_no_scene_and_a_folder_are_problems(tmp_path: Path) -> None:
    with pytest.raises(Problem, match="No scene"):
        BuildOptions((), "glass")
    with pytest.raises(Problem, match="is a folder"):
        BuildOptions((tmp_path,), "glass")


@pytest.mark.parametrize("second", ["./bottles.usda", "bottles.usdc"])
def test_a_scene_given_twice_is_a_problem(second: str, scenes: tuple[Path, ...], tmp_path: Path) -> None:
    (tmp_path / "bottles.usdc").write_text("")
    with pytest.raises(Problem, match="more than once"):
        BuildOptions((*scenes, tmp_path / second), "glass")


@pytest.mark.parametrize("by_stem", [True, False])
def test_held_out_scenes_are_named_by_path_or_stem(by_stem: bool, scenes: tuple[Path, ...]) -> None:
    wanted = Path("knots") if by_stem else scenes[2].parent / "." / "knots.usda"
    options = BuildOptions(scenes, "glass", holdout=(wanted,))
    assert options.holdout == (scenes[2],)
    assert options.training == (scenes[0], scenes[1], scenes[3])


def test_holding_out_everything_is_a_problem(scenes: tuple[Path, ...]) -> None:
    with pytest.raises(Problem, match="none is left to train on"):
        BuildOptions(scenes, "glass", holdout=scenes)


def test_a_stem_that_two_scenes_have_is_ambiguous(scenes: tuple[Path, ...], tmp_path: Path) -> None:
    (tmp_path / "sub").mkdir()
    twin = tmp_path / "sub" / "bottles.usda"
    twin.write_text("")
    with pytest.raises(Problem, match="more than one of the scenes"):
        BuildOptions((*scenes, twin), "glass", holdout=(Path("bottles"),))
    options = BuildOptions((*scenes, twin), "glass", holdout=(twin,))
    assert options.holdout == (twin,)
    assert options.labels[twin] == "sub/bottles"
    assert options.labels[scenes[0]] == f"{tmp_path.name}/bottles"
    assert options.labels[scenes[1]] == "foliage"


def test_a_quarter_is_held_out_by_default_whatever_the_order(scenes: tuple[Path, ...]) -> None:
    assert len(default_holdout(scenes)) == 1
    assert default_holdout(scenes) == default_holdout(scenes[::-1])
    assert default_holdout(scenes[:1]) == ()
    assert BuildOptions(scenes, "glass").holdout == default_holdout(scenes)


def test_texts_are_parsed__yes() -> None:
    texts = {"budgets": "4,2.5, 1", "size": "64x48", "seed": 7, "steps": None}
    assert given(Options, texts) == {"budgets": (4.0, 2.5, 1.0), "width": 64, "height": 48, "seed": 7}
    assert parse_size("1430x960") == (1430, 960)
    assert parse_tail("paper") == "paper"
    assert parse_glass("plain") == "plain"


@pytest.mark.parametrize("text", ["", "1430", "1430x", "x960", "1430 x 960x2", "-1x2", "1.5x2"])
def test_sizes_are_parsed__no(text: str) -> None:
    with pytest.raises(Problem, match="is not a size"):
        parse_size(text)


def test_other_texts_are_parsed__no() -> None:
    with pytest.raises(Problem, match="--budgets '1;2' is not a list of numbers") as caught:
        given(Options, {"budgets": "1;2"})
    assert caught.value.remedy == "Write it like --budgets .5,1,2."
    with pytest.raises(Problem, match="no tail 'dense'"):
        parse_tail("dense")
    with pytest.raises(Problem, match="no reading of glass 'thick'"):
        parse_glass("thick")
