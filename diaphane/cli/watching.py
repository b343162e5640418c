"""How a job goes, while it goes: bars on a terminal, lines in a log, nothing for `--json`; all on stderr."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, Protocol, TextIO

from diaphane.cli.lines import plain, seconds
from diaphane.client import Client, Record
from diaphane.client.jobs import FINAL_STATES
from schemas.problem import ExitCode, Problem

if TYPE_CHECKING:
    from rich.progress import Progress, TaskID

REFRESH_SECONDS = 1.0
LINE_SECONDS = 10.0
"""How often a log gets a line about a stage that goes on."""
_LOG_LINES = 20


class Screen(Protocol):
    """Where the state of a job is shown."""

    def show(self, job: dict[str, Any]) -> None:
        """The job as it is now."""

    def note(self, text: str) -> None:
        """One line that the user should see."""


def follow(server: Client, job_id: str, *, silent: bool = False, stream: TextIO | None = None) -> Record:
    """Shows a job until it ends.

    Args:
        server: The server.
        job_id: The job.
        silent: Whether nothing is shown.
        stream: Where it is shown; None: stderr.

    Returns:
        The job in its final state.

    Raises:
        Problem: Interrupted: the job itself goes on.
    """
    try:
        with _screen(stream or sys.stderr, silent=silent) as screen:
            shown = 0.0
            for event in server.jobs.events(job_id):
                if event["kind"] == "log":
                    for line in _log_lines(event["data"]):
                        screen.note(line)
                if time.monotonic() - shown >= REFRESH_SECONDS:
                    screen.show(server.jobs.get(job_id))
                    shown = time.monotonic()
            job = server.jobs.get(job_id)
            screen.show(job)
            return job
    except KeyboardInterrupt:
        raise Problem(
            f"Stopped watching; the job {job_id} continues.",
            f"Watch it again with: diaphane jobs watch {job_id}; stop it with: diaphane jobs cancel {job_id}",
            ExitCode.INTERRUPTED,
        ) from None


def ensure_success(job: dict[str, Any]) -> None:
    """Raises the problem that a job ended with.

    Raises:
        Problem: It failed, or was cancelled.
    """
    if job["state"] == "cancelled":
        raise Problem(
            f"The job {job['id']} was cancelled.",
            f"Continue it with: diaphane jobs retry {job['id']}",
            ExitCode.INTERRUPTED,
        )
    if job["state"] == "failed":
        problem = job.get("problem") or {}
        reason = plain(problem.get("detail") or problem.get("title") or "no reason was given.")
        remedy = plain(problem.get("remedy") or f"See: diaphane jobs events {job['id']}")
        retry = f"Once that is done: diaphane jobs retry {job['id']}"
        raise Problem(f"The job {job['id']} failed: {reason}", f"{remedy} {retry}", ExitCode.CHECK_FAILED)


@contextmanager
def _screen(stream: TextIO, *, silent: bool) -> Iterator[Screen]:
    if silent:
        yield _Nothing()
    elif not stream.isatty():
        yield Lines(stream)
    else:
        with _bars(stream) as bars:
            yield Bars(bars)


class _Nothing:
    def show(self, job: dict[str, Any]) -> None:
        """See `Screen.show`."""

    def note(self, text: str) -> None:
        """See `Screen.note`."""


class Lines:
    """A line for each change of state, for each stage that begins or ends, and now and then between.

    Args:
        stream: Where the lines go.
    """

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self._state = ""
        self._last: dict[str, str] = {}
        self._when: dict[str, float] = {}

    def note(self, text: str) -> None:
        """See `Screen.note`."""
        print(plain(text), file=self._stream, flush=True)

    def show(self, job: dict[str, Any]) -> None:
        """See `Screen.show`."""
        if job["state"] == self._state:
            self._show_stages(job)
            return
        self._state = job["state"]
        if self._state in FINAL_STATES:
            self._show_stages(job)
        self.note(f"{job['id']}: {self._state}")
        self._show_stages(job)

    def _show_stages(self, job: dict[str, Any]) -> None:
        for stage in job.get("stages", ()):
            self._show_stage(stage)

    def _show_stage(self, stage: dict[str, Any]) -> None:
        name, text, now = stage["stage"], _counts(stage), time.monotonic()
        if self._last.get(name) == text:
            return
        if name not in self._last or _is_over(stage) or now - self._when[name] >= LINE_SECONDS:
            self._last[name], self._when[name] = text, now
            left = _left(stage)
            self.note(f"{name}: {text}" + (f", about {left}" if left else ""))


class Bars:
    """A bar for each stage, and one for the whole job.

    Args:
        bars: On the terminal.
    """

    def __init__(self, bars: Progress) -> None:
        self._bars = bars
        self._tasks: dict[str, TaskID] = {}

    def note(self, text: str) -> None:
        """See `Screen.note`."""
        self._bars.console.print(plain(text), markup=False, highlight=False, soft_wrap=True)

    def show(self, job: dict[str, Any]) -> None:
        """See `Screen.show`."""
        for stage in job.get("stages", ()):
            self._bar(stage["stage"], stage.get("fraction", 0.0), _counts(stage), _left(stage))
        self._bar("job", job.get("fraction", 0.0), job["state"], _left(job))

    def _bar(self, name: str, fraction: float, counts: str, left: str) -> None:
        if name not in self._tasks:
            self._tasks[name] = self._bars.add_task(name, total=1.0, counts="", left="")
        self._bars.update(self._tasks[name], completed=fraction, counts=counts, left=left)


def _bars(stream: TextIO) -> Progress:
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn

    return Progress(
        TextColumn("{task.description:<10}", markup=False),
        BarColumn(bar_width=28),
        TextColumn("{task.fields[counts]}", markup=False),
        TextColumn("{task.fields[left]}", markup=False, style="dim"),
        console=Console(file=stream),
    )


def _counts(stage: dict[str, Any]) -> str:
    ended = sum(stage.get(name, 0) for name in ("done", "skipped", "quarantined"))
    details = [f"{stage[name]} {name}" for name in ("skipped", "quarantined") if stage.get(name)]
    return f"{ended}/{stage.get('total', 0)}" + (f" ({', '.join(details)})" if details else "")


def _is_over(stage: dict[str, Any]) -> bool:
    return not stage.get("running") and not stage.get("queued")


def _left(progress: dict[str, Any]) -> str:
    """How long a stage or a job still takes; nothing where that is not known, or hardly any."""
    eta = progress.get("eta_seconds")
    return f"{seconds(eta)} to go" if eta is not None and eta >= 1.0 else ""


def _log_lines(data: Any) -> list[str]:
    """What a log event says, without the frames of a traceback: those are in `diaphane jobs events`."""
    if not isinstance(data, dict):
        return [str(data)]
    lines = [line for line in str(data.get("text", "")).split("\n") if line.strip()]
    if any(line.startswith("Traceback") for line in lines):
        lines = [line for line in lines if not line[0].isspace() and not line.startswith("Traceback")]
    where = f"{data['stage']} of {data.get('name')}: " if "stage" in data else ""
    return [f"{where}{line}" for line in lines[:_LOG_LINES]]
