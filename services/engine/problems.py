"""What can go wrong with a task or a job, in words for its owner."""

from __future__ import annotations

import signal
from typing import Final

from evaluation.wording import counted
from schemas.problem import ExitCode, Problem
from schemas.service import ProblemDocument
from services.problems import document_of

FINAL_CODES: Final = (
    ExitCode.USAGE,
    ExitCode.NOT_FOUND,
    ExitCode.LIMIT,
    ExitCode.CHECK_FAILED,
    ExitCode.AUTH,
    ExitCode.CONFLICT,
)
"""A task that ends with one of these ends with it again, so it is not repeated."""

LOST_JOB: Final = document_of(
    Problem(
        "The processes that conducted the job were lost again and again.",
        "Look into the workers' logs for the reason, then retry the job: what was made is kept.",
        ExitCode.TRY_AGAIN,
    )
)


class TaskError(Exception):
    """A task failed in a way that another try may not.

    Args:
        problem: What its owner is told if it fails to the end.
    """

    def __init__(self, problem: Problem) -> None:
        super().__init__(problem.title)
        self.problem = problem


class Crashed(TaskError):
    """The process of a task ended by itself, or was killed."""


class TimedOut(TaskError):
    """A task took longer than it may."""


def crashed(title: str, code: int | None) -> Crashed:
    """The process that did a task ended by itself.

    Args:
        title: The task in words.
        code: Exit code; negative: a signal.
    """
    if code is not None and code < 0:
        name = signal.Signals(-code).name if -code in set(signal.Signals) else f"signal {-code}"
        how = f"was ended by {name}"
        remedy = (
            "The machine was probably out of memory: use a bigger one, or a smaller scene or picture."
            if name == "SIGKILL"
            else "Something in its input makes a library crash: simplify the scene, or leave it out."
        )
    else:
        how, remedy = f"ended with status {code}", "Look into the job's log for the reason."
    return Crashed(Problem(f"The process of {title} {how}.", remedy, ExitCode.TRY_AGAIN))


def timed_out(title: str, seconds: float) -> TimedOut:
    """A task took longer than it may."""
    return TimedOut(
        Problem(
            f"{title} was not done within {seconds:g} s.",
            "Simplify the scene, or raise DIAPHANE_TASK_SECONDS or DIAPHANE_TRAIN_SECONDS of the workers.",
            ExitCode.TRY_AGAIN,
        )
    )


def failed(title: str, summary: str) -> TaskError:
    """A task's body raised something unexpected."""
    return TaskError(
        Problem(f"{title} failed: {summary}", "The job's log has the details; please report them.", ExitCode.TRY_AGAIN)
    )


def lost(count: int) -> ProblemDocument:
    """A task was under way on executors that were lost, each time."""
    return document_of(
        Problem(
            f"Lost while at work on it: {counted(count, 'workers')}.",
            "It probably exhausts the memory of the machine: use a bigger one, or leave its scene or view out.",
            ExitCode.TRY_AGAIN,
        )
    )


def unmade(artifact: str) -> Problem:
    """An artifact is gone and no task tells how to make it."""
    return Problem(
        f"The artifact {artifact} is gone, and nothing tells how to make it again.",
        "Submit a job that starts from the scenes.",
        ExitCode.NOT_FOUND,
    )
