"""The page of a training under way."""

from __future__ import annotations

import re
from pathlib import Path

from evaluation.report.live import write_live
from trainer.log import LogLine


def line(step: int, score: float | None = None) -> LogLine:
    return LogLine(step=step, loss=1.0 / step, score=score, lr=0.004, seconds=0.1 * step, rows_per_second=123_456.0)


def test_the_page_shows_the_log_and_loads_itself_again_until_it_is_over(tmp_path: Path) -> None:
    page = tmp_path / "glass.html"
    write_live(page, "<glass>", [], 200)
    assert "has not begun" in page.read_text()
    lines = [line(50), line(100, 3.0), line(150), line(200, 2.5)]
    write_live(page, "<glass>", lines[:3], 200)
    text = page.read_text()
    assert "Step 150 of 200, 15 s, 123,456 rows/s" in text
    assert 'http-equiv="refresh"' in text
    assert text.count('<script type="application/json">') == 1, "one validation is no line yet"
    assert "&lt;glass&gt;" in text
    write_live(page, "<glass>", lines, 200, is_over=True)
    text = page.read_text()
    assert text.count('<script type="application/json">') == 2
    assert "refresh" not in text
    assert list(tmp_path.iterdir()) == [page]


def test_the_page_needs_no_network(tmp_path: Path) -> None:
    page = tmp_path / "glass.html"
    write_live(page, "glass", [line(50, 2.0), line(100, 1.5)], 200)
    text = page.read_text().replace("http-equiv", "")
    assert not re.search(r"(src|href)=", text.partition("<script>")[0])
    assert "http" not in text.partition("<script")[0]
