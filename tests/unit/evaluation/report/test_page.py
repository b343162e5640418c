"""The page: one file that needs nothing else, says what was measured, and survives any names."""

from __future__ import annotations

import re
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import pytest
from support.measured import example, measurement, picture_set

from evaluation.report import write_report
from schemas.measurement import Certificate, RegistryResult, ReportData, SceneSummary, TrainingPoint

VOID = {"meta", "img", "path", "circle", "polygon", "polyline", "br", "input"}


class Balance(HTMLParser):
    """Fails on tags that do not match."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.text = ""

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        if tag not in VOID:
            assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if not self.open or self.open[-1] not in ("style", "script"):
            self.text += f"{data} "


def scene(label: str, held_out: bool, warnings: tuple[str, ...] = ()) -> SceneSummary:
    return SceneSummary(label=label, held_out=held_out, views=2, triangles=12345, fragments=678901, warnings=warnings)


def report_data(**changes: Any) -> ReportData:
    fields: dict[str, Any] = {
        "name": "glass",
        "command": "diaphane build a.usda b.usda --name glass",
        "created": "2025-01-02T03:04:05+00:00",
        "scenes": (scene("bottles", True), scene("foliage", True), scene("knots", False)),
        "measurements": tuple(example() + example("foliage")),
        "certificates": (
            Certificate(
                scene="bottles", view="front", budget_factor=1.0, error=2.0, bound=1.9, gap=0.05, rules={"greedy": 3.0}
            ),
        ),
        "training": (
            TrainingPoint(step=0, loss=1.0, over_optimum=3.0),
            TrainingPoint(step=10, loss=0.5, over_optimum=2.5),
        ),
        "registry": RegistryResult(
            reference="glass@1.0.0", folder="/state/1.0.0", champion=True, reason="It is the first version.", score=0.2
        ),
        "skipped": {"views already captured": 3},
        "machine": {"processor": "Example"},
        "versions": {"python": "3.11"},
        "provenance": {"seed": 0},
    }
    return ReportData(**{**fields, **changes})


def write(tmp_path: Path, **changes: Any) -> tuple[str, str]:
    """Writes a report; returns its source and its text."""
    path = tmp_path / "reports" / "glass.html"
    write_report(path, report_data(**changes), iter([picture_set()]))
    html = path.read_text(encoding="utf-8")
    parser = Balance()
    parser.feed(html)
    assert parser.open == []
    assert list(path.parent.iterdir()) == [path]
    return html, " ".join(parser.text.split())


def test_the_page_needs_nothing_else(tmp_path: Path) -> None:
    html, _ = write(tmp_path)
    assert "://" not in html.partition("<script")[0]
    assert not re.search(r"(src|href)=.https?:", html)
    assert all(source.startswith("data:") for source in re.findall(r'src="([^"]*)"', html))
    assert "<link" not in html


def test_the_page_says_what_was_measured(tmp_path: Path) -> None:
    _, text = write(tmp_path)
    for words in (
        "glass@1.0.0",
        "On 2 scenes that were not trained on: the bundle's squared error is 0.200 times that of VKB",
        "It is the first version.",
        "fixed k (kbuffer)",
        "oracle (kbuffer-optimal)",
        "views already captured 3",
        "The largest gap is 0.0500",
        "diaphane build a.usda b.usda --name glass",
    ):
        assert words in text


def test_a_wide_table_scrolls_and_the_page_does_not(tmp_path: Path) -> None:
    html, _ = write(tmp_path)
    assert html.count("<table") == html.count('<div class="scroll"><table>') > 0


def test_every_anchor_leads_somewhere(tmp_path: Path) -> None:
    html, _ = write(tmp_path)
    targets = re.findall(r'href="#([^"]+)"', html)
    assert len(targets) == 9
    assert all(f'id="{target}"' in html for target in targets)


def test_scenes_that_were_trained_on_do_not_enter_the_results(tmp_path: Path) -> None:
    cheat = measurement("kbuffer-deep", 1e-9, scene="knots")
    _, without = write(tmp_path)
    _, text = write(tmp_path, measurements=(*example(), *example("foliage"), cheat))
    assert "0.200 times that of VKB" in text
    assert "no evidence of anything" in text
    assert "no evidence of anything" not in without


def test_a_report_without_held_out_scene_says_that_it_proves_nothing(tmp_path: Path) -> None:
    _, text = write(tmp_path, scenes=(scene("bottles", False),), measurements=tuple(example()))
    assert "this build proves nothing" in text
    assert "times that of VKB" not in text


def test_names_are_text_and_never_markup(tmp_path: Path) -> None:
    evil = '<script>alert("1")</script>'
    html, text = write(
        tmp_path,
        scenes=(scene(evil, True, (evil,)),),
        measurements=tuple(example(evil)),
        command=evil,
        provenance={evil: evil},
        machine={evil: evil},
    )
    assert "<script>alert" not in html
    assert evil in text


@pytest.mark.parametrize("missing", ["certificates", "training", "measurements", "skipped"])
def test_missing_parts_leave_no_empty_heading(missing: str, tmp_path: Path) -> None:
    _, text = write(tmp_path, **{missing: {} if missing == "skipped" else ()})
    heading = {"certificates": "Certificates of", "training": "Loss", "measurements": "Results", "skipped": "already"}
    assert heading[missing] not in text


def test_what_was_not_run_is_listed_with_counts(tmp_path: Path) -> None:
    extra = [
        measurement("kbuffer", None, view="side", skipped="no transparent fragment"),
        measurement("kbuffer", 0.0, view="top", exact=True),
    ]
    _, text = write(tmp_path, measurements=(*example(), *extra))
    assert "fixed k (kbuffer): no transparent fragment 1" in text
    assert "fit in the budget (exact) 1" in text
