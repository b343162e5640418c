from __future__ import annotations

from support.measured import example, measurement

from services.dashboard.measured import compare


def test_who_wins_is_said_of_the_views_that_all_have() -> None:
    assert compare(example(), "bottles").best == {1.0: "kbuffer-deep", 2.0: "kbuffer-deep"}
    # The mean over an easy view alone would be less than that over both.
    easy = measurement("kbuffer", 1e-6, view="easy")
    easier = measurement("kbuffer-deep", 1e-7, view="easy")
    hard = measurement("kbuffer-deep", 2e-5)
    assert compare([easy, easier, hard], "bottles").best == {1.0: "kbuffer-deep"}
    assert compare([easy, hard], "bottles").best == {}


def test_what_no_renderer_can_run_or_is_exact_wins_nothing() -> None:
    found = [measurement("kbuffer-optimal", 1e-9), measurement("sbuffer", 0.0), measurement("kbuffer", 1e-4)]
    assert compare(found, "bottles").best == {1.0: "kbuffer"}
