"""How advice is said."""

from __future__ import annotations

import pytest
from support.advice import FRAME, MIB, sample, scene

from evaluation.advice.amounts import parse_frame, parse_memory
from evaluation.advice.page import page
from evaluation.advice.rules import advise
from evaluation.advice.words import Asked, commands, said_mse, sentences, sizes, table
from schemas.problem import Problem

DEEP = sample("kbuffer-deep", 40.0, 1e-6, 1.0, tail="binned-12", bundle="b@1")
SUMS = sample("weighted-blended", 20.0, 1e-3)
ASKED = Asked("a b.usd", ("--alpha", "0.3"), None, "benchmarks/bundle")


def test_exact_is_said_with_its_bytes_and_where_a_budget_pays() -> None:
    first = sentences(advise(scene(2.0, DEEP), FRAME, 64 * MIB))[0]
    assert first == (
        "2.00 fragments per pixel: use the S-buffer (sbuffer). It is exact and takes 19.1 MiB of 64.0 MiB at "
        "1000x1000. A budget pays above 7.89 fragments per pixel, where the S-buffer does not fit any more."
    )


def test_a_technique_is_said_with_budget_tail_bundle_bytes_and_error() -> None:
    first = sentences(advise(scene(20.0, DEEP, SUMS), FRAME, 64 * MIB))[0]
    assert "Use bundle (kbuffer-deep), budget 1, binned-12 tail, bundle b@1: 38.1 MiB, MSE 0.100e-5" in first
    assert "the S-buffer, which is exact, takes 156.4 MiB, and 64.0 MiB at 1000x1000 hold 7.89 per pixel" in first


def test_ties_are_said() -> None:
    near = sample("moment", 30.0, 1e-6)
    told = sentences(advise(scene(20.0, DEEP, near), FRAME, 64 * MIB))[0]
    assert "As good within what other views would change, but larger: bundle (kbuffer-deep), budget 1" in told


def test_peeling_is_told_where_the_s_buffer_does_not_fit() -> None:
    peeled = sample("depth-peeling", 20.0, 0.0, family="exact")
    told = " ".join(sentences(advise(scene(20.0, peeled, DEEP), FRAME, 64 * MIB)))
    assert "depth-peeling fits too, exact in 19.1 MiB" in told
    assert "up to 80 times" in told


def test_nothing_transparent_and_nothing_that_fits_say_so() -> None:
    nothing, tight = advise(scene(0.0), FRAME, MIB), advise(scene(20.0, SUMS), FRAME, MIB)
    assert sentences(nothing)[0].startswith("Nothing transparent is seen in 1 view")
    assert "nothing that was measured fits 1.00 MiB" in sentences(tight)[0]
    assert sentences(advise(scene(20.0), FRAME, MIB))[0].count("156.4 MiB") == 1
    assert commands(tight, ASKED) == ("diaphane advise 'a b.usd' --alpha 0.3 --memory 20MiB --size 1000x1000",)


def test_commands_ask_as_was_asked() -> None:
    render, bench, build = commands(advise(scene(20.0, DEEP, SUMS), FRAME, 64 * MIB), ASKED)
    assert render == (
        "diaphane render 'a b.usd' --alpha 0.3 -t kbuffer-deep --budget 1 --bundle benchmarks/bundle --size 1000x1000 "
        "-o out.png --compare"
    )
    assert "-t sbuffer,kbuffer-deep --budgets 1 --bundle benchmarks/bundle" in bench
    assert build.endswith("--from benchmarks/bundle --budgets 1 --name mine")


def test_tables_mark_the_advice_and_say_exact() -> None:
    advice = advise(scene(20.0, DEEP, SUMS), FRAME, 64 * MIB)
    assert [row[4] for row in table(advice)] == ["advised", "fits", "no"]
    assert table(advice)[2][3] == "exact"
    chosen = ["bundle (kbuffer-deep)"] * 2 + ["weighted-blended", "nothing fits", "nothing fits"]
    assert [row[2].partition(",")[0] for row in sizes(advice)] == chosen
    assert said_mse(1e-8) == "≤ 0.00100"


def test_a_page_holds_every_scene_and_hides_nothing_hostile() -> None:
    advice = advise(scene(20.0, DEEP, SUMS), FRAME, 64 * MIB)
    hostile = advice.model_copy(update={"warnings": ("<script>x</script>",), "text": sentences(advice)})
    html = page([(hostile, None), (advice, None)], "diaphane advise")
    assert "<script>x" not in html
    assert html.count("<h2>panes</h2>") == 2
    assert "bundle (kbuffer-deep), budget 1" in html
    assert html.count('<script type="application/json">') == 2


@pytest.mark.parametrize(
    ("text", "count"), [("64MiB", 64 * MIB), ("1.5 GiB", 3 * 2**29), ("500mb", 500 * 10**6), ("10B", 10)]
)
def test_memory_is_read_with_its_unit(text: str, count: int) -> None:
    assert parse_memory(text) == count


@pytest.mark.parametrize("text", ["64", "MiB", "-1MiB", "0MiB", "64 TiB", ""])
def test_what_is_no_memory_is_refused(text: str) -> None:
    with pytest.raises(Problem, match="Invalid memory"):
        parse_memory(text)


def test_a_frame_without_pixels_is_refused() -> None:
    with pytest.raises(Problem, match="no pixels"):
        parse_frame("0x10")
