"""Progress: lines in a log, bars on a terminal, and a tally of what was skipped."""

from __future__ import annotations

import io

import pytest
from rich.console import Console

from evaluation.progress import PlainProgress, Progress, RichProgress, SilentProgress, make_progress


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def work(progress: Progress) -> None:
    with progress.stage("capture", 2) as stage:
        stage.advance(note="scene [a]")
        stage.advance()
    progress.note("kept [two] views")


def test_plain_progress_writes_a_line_when_a_stage_begins_and_ends() -> None:
    stream = io.StringIO()
    work(PlainProgress(stream))
    lines = stream.getvalue().splitlines()
    assert lines[0] == "capture: 2"
    assert lines[1].startswith("capture: done in ")
    assert lines[2] == "kept [two] views"


def test_rich_progress_shows_names_as_they_are() -> None:
    stream = Terminal()
    work(RichProgress(Console(file=stream, force_terminal=True, width=160)))
    assert "capture" in stream.getvalue()
    assert "2/2" in stream.getvalue()
    assert "kept [two] views" in stream.getvalue()


def test_a_bar_that_is_interrupted_gives_the_terminal_back() -> None:
    stream = Terminal()
    progress = RichProgress(Console(file=stream, force_terminal=True, width=160))
    with pytest.raises(KeyboardInterrupt), progress.stage("capture", 2):
        raise KeyboardInterrupt
    assert stream.getvalue().rfind("\x1b[?25h") > stream.getvalue().rfind("\x1b[?25l")


def test_every_kind_counts_what_was_skipped() -> None:
    for progress in (SilentProgress(), PlainProgress(io.StringIO()), RichProgress(Console(file=io.StringIO()))):
        progress.skipped("views", 2)
        progress.skipped("views")
        assert progress.skips == {"views": 3}


def test_the_kind_follows_the_stream() -> None:
    assert isinstance(make_progress(io.StringIO()), PlainProgress)
    assert isinstance(make_progress(Terminal()), RichProgress)
    assert type(make_progress(Terminal(), silent=True)) is SilentProgress
