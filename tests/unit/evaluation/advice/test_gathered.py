"""Advice by what a benchmark or jobs measured."""

from __future__ import annotations

import math

from support.api import measurement
from support.bench import cell, view

from evaluation.advice.gathered import of_bench, of_measurements
from schemas.advice import Size
from schemas.measurement import Measurement

SMALL = Size(width=10, height=10)


def test_a_benchmark_is_advised_on_by_its_cells() -> None:
    advice = of_bench("panes", [view(cell(), cell("kbuffer-optimal"), cell("weighted-blended"), cell("sbuffer"))])
    assert advice.choice.chosen is not None
    assert advice.choice.chosen.technique == "sbuffer"
    assert advice.choice.chosen.bytes_at(SMALL.pixels) == 8 * 400 + 4 * 100
    assert {one.technique for one in advice.best} == {"kbuffer", "weighted-blended", "sbuffer"}
    assert advice.text[0].startswith("4.00 fragments per pixel: use the S-buffer")


def test_cells_without_a_picture_are_left_out() -> None:
    lost = cell("moment", mse=None, problem="no room", total_bytes=None)
    assert "moment" not in {one.technique for one in of_bench("panes", [view(cell(), lost)]).best}


def test_measurements_of_jobs_give_advice_for_any_memory_and_size() -> None:
    base = Measurement.model_validate(measurement())
    size = Size(width=base.width, height=base.height)
    dear = {"total_fragments": 20 * size.pixels, "skipped": None, "exact": False}
    mine = base.model_copy(update={**dear, "technique": "kbuffer-deep", "mse": 1e-5, "total_bytes": 50 * size.pixels})
    other = base.model_copy(update={**dear, "technique": "kbuffer", "mse": 1e-3, "total_bytes": 40 * size.pixels})
    given = [(mine, "glass@1"), (other, ""), (mine.model_copy(update={"mse": 1.0}), "glass@1")]
    advice = of_measurements("panes", given, None, 60 * size.pixels)
    assert advice is not None
    assert advice.choice.chosen is not None
    assert (advice.choice.chosen.technique, advice.choice.chosen.bundle) == ("kbuffer-deep", "glass@1")
    assert math.isclose(advice.choice.chosen.mse, 1e-5)  # the first of two of the same counts
    large = of_measurements("panes", given, Size(width=4 * size.width, height=size.height), 60 * size.pixels)
    assert large is not None
    assert large.choice.verdict == "none"


def test_nothing_measured_is_no_advice() -> None:
    assert of_measurements("panes", []) is None
