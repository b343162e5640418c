"""Means, ratios and the sentence that is made of them."""

from __future__ import annotations

import pytest
from support.measured import example, measurement

from evaluation import summary
from evaluation.looks import technique_order


def test_the_score_is_the_geometric_mean_over_pairs() -> None:
    pairs = [
        measurement("kbuffer-deep", 1e-5),
        measurement("kbuffer-importance", 4e-5),
        measurement("kbuffer-deep", 2e-5, view="back"),
        measurement("kbuffer-importance", 2e-5, view="back"),
    ]
    assert summary.score(pairs) == pytest.approx(0.5)


def test_only_pairs_of_the_same_view_and_budget_are_compared() -> None:
    alone = [
        measurement("kbuffer-deep", 1e-5),
        measurement("kbuffer-importance", 4e-5, view="back"),
        measurement("kbuffer-importance", 4e-5, budget_factor=2.0),
        measurement("kbuffer-importance", 4e-5, scene="foliage"),
    ]
    assert summary.score(alone) is None


def test_exact_and_skipped_measurements_are_not_compared() -> None:
    pairs = [
        measurement("kbuffer-deep", 0.0, exact=True),
        measurement("kbuffer-importance", 0.0, exact=True),
        measurement("kbuffer-deep", None, view="back", skipped="no transparent fragment"),
        measurement("kbuffer-importance", 1e-5, view="back"),
    ]
    assert summary.score(pairs) is None
    assert summary.sentence(pairs).startswith("No view and budget could be compared")


def test_errors_below_the_floor_count_as_the_floor_and_two_of_them_as_nothing() -> None:
    lossless = [measurement("kbuffer-deep", 0.0), measurement("kbuffer-importance", 1e-12)]
    assert summary.score(lossless) is None
    lossy = [measurement("kbuffer-deep", 0.0), measurement("kbuffer-importance", 4.0 * summary.MSE_FLOOR)]
    assert summary.score(lossy) == pytest.approx(0.25)


def test_the_sentence_counts_where_the_bundle_is_worse() -> None:
    good = example()
    assert "it is nowhere worse than VKB" in summary.sentence(good)
    assert "0.200 times that of VKB" in summary.sentence(good)
    assert "2.00 times that of the optimal" in summary.sentence(good)
    bad = [measurement("kbuffer-deep", 3e-4, view="back"), measurement("kbuffer-importance", 1e-4, view="back")]
    assert "it is worse than VKB in 1" in summary.sentence(good + bad)


def test_rows_are_by_budget_then_technique() -> None:
    rows = summary.rows(example() + example("foliage"))
    assert [(r.budget_factor, r.technique) for r in rows[:4]] == [
        (1.0, "kbuffer"),
        (1.0, "kbuffer-importance"),
        (1.0, "kbuffer-deep"),
        (1.0, "kbuffer-optimal"),
    ]
    deep = rows[2]
    assert deep.views == 2
    assert deep.mse == pytest.approx(2e-5)
    assert deep.psnr == pytest.approx(46.9897, abs=1e-3)
    assert deep.over_baseline == pytest.approx(0.2)
    assert deep.ms == 10.0


def test_exact_views_are_counted_and_left_out_of_the_errors() -> None:
    row = summary.rows([measurement(mse=1e-5), measurement(mse=0.0, view="back", exact=True, total_ms=40.0)])[0]
    assert (row.views, row.exact_views) == (2, 1)
    assert row.mse == pytest.approx(1e-5)
    assert row.ms == 30.0


def test_techniques_come_in_the_order_of_the_titles_then_by_name() -> None:
    given = ["adaptive", "kbuffer-deep", "moment", "kbuffer", "kbuffer"]
    assert technique_order(given) == ["kbuffer", "kbuffer-deep", "moment", "adaptive"]


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (None, "–"),
        (0.0, "0.00"),
        (1.0, "1.00"),
        (12.345, "12.3"),
        (0.99999, "1.00"),
        (1234.5, "1234"),
        (0.01234, "0.0123"),
        (1.2e-5, "1.20e-05"),
        (1e7, "1.00e+07"),
        (-3.14159, "-3.14"),
    ],
)
def test_numbers_have_three_significant_digits(value: float | None, text: str) -> None:
    assert summary.number(value) == text
