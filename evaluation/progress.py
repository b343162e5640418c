"""How long work tells the user where it is: bars on a terminal, lines in a log, nothing for `--json`.

Everything goes to stderr; stdout belongs to the result. rich is imported by what draws: child processes, which only
report, start without it.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from typing import TYPE_CHECKING, Protocol, TextIO

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import Progress as RichBars
    from rich.progress import TaskID


class Stage(Protocol):
    """A stage under way."""

    def advance(self, n: int = 1, note: str = "") -> None:
        """`n` more of the stage's total are done; `note` says which one, or how it went."""


class Progress(Protocol):
    """Where a pipeline reports to.

    Attributes:
        skips: What was not done because it did not need to be, with counts, over the whole run.
    """

    skips: Counter[str]

    def stage(self, name: str, total: int) -> AbstractContextManager[Stage]:
        """A stage of `total` steps, over when the context is left."""

    def note(self, text: str) -> None:
        """One line that the user should see."""

    def skipped(self, what: str, count: int = 1) -> None:
        """`count` pieces of work of one kind were not needed, e.g. 'views already captured'."""


class SilentProgress:
    """Counts what was skipped and shows nothing."""

    def __init__(self) -> None:
        self.skips: Counter[str] = Counter()

    @contextmanager
    def stage(self, name: str, total: int) -> Iterator[Stage]:
        """See `Progress.stage`."""
        yield _SilentStage()

    def note(self, text: str) -> None:
        """See `Progress.note`."""

    def skipped(self, what: str, count: int = 1) -> None:
        """See `Progress.skipped`."""
        self.skips[what] += count


class _SilentStage:
    def advance(self, n: int = 1, note: str = "") -> None:
        """See `Stage.advance`."""


class PlainProgress(SilentProgress):
    """A line when a stage begins and one when it ends: for logs and pipes.

    Args:
        stream: Where the lines go.
    """

    def __init__(self, stream: TextIO) -> None:
        super().__init__()
        self._stream = stream

    @contextmanager
    def stage(self, name: str, total: int) -> Iterator[Stage]:
        """See `Progress.stage`."""
        self.note(f"{name}: {total}")
        started = time.monotonic()
        yield _SilentStage()
        self.note(f"{name}: done in {time.monotonic() - started:.1f} s")

    def note(self, text: str) -> None:
        """See `Progress.note`."""
        print(text, file=self._stream, flush=True)


class RichProgress(SilentProgress):
    """A bar for every stage on a terminal.

    Args:
        console: A console on stderr.
    """

    def __init__(self, console: Console) -> None:
        super().__init__()
        self._console = console

    @contextmanager
    def stage(self, name: str, total: int) -> Iterator[Stage]:
        """See `Progress.stage`."""
        from rich import progress

        bars = progress.Progress(
            progress.TextColumn("{task.description:<22}"),
            progress.BarColumn(bar_width=28),
            progress.MofNCompleteColumn(),
            progress.TimeElapsedColumn(),
            progress.TimeRemainingColumn(),
            progress.TextColumn("[dim]{task.fields[note]}"),
            console=self._console,
        )
        with bars:
            task = bars.add_task(name, total=total, note="")
            yield _RichStage(bars, task)
            bars.update(task, note="")

    def note(self, text: str) -> None:
        """See `Progress.note`."""
        self._console.print(text, markup=False, highlight=False, soft_wrap=True)


class _RichStage:
    def __init__(self, bars: RichBars, task: TaskID) -> None:
        self._bars, self._task = bars, task

    def advance(self, n: int = 1, note: str = "") -> None:
        """See `Stage.advance`."""
        # The note is data (a file's name), not markup.
        self._bars.update(self._task, advance=n, note=note.replace("[", r"\["))


def make_progress(stream: TextIO, *, silent: bool = False) -> Progress:
    """The kind that suits `stream`: bars on a terminal, lines elsewhere, nothing if `silent`."""
    if silent:
        return SilentProgress()
    if stream.isatty():
        from rich.console import Console

        return RichProgress(Console(file=stream))
    return PlainProgress(stream)
