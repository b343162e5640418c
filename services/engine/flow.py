"""The workflows: a job, a task, a check of a scene. What is durable of them lies in `states` and `task_states`."""

from __future__ import annotations

from typing import Protocol

from dbos import DBOS

from services.engine.task_states import LOST_EXECUTORS

JOB_EXECUTORS = 100
"""Executors that may be lost while they conduct a job; then it fails."""


class Host(Protocol):
    """The process that workflows run in."""

    def conduct(self, workflow_id: str, job_id: str, attempt: int) -> None:
        """Runs a job."""

    def work(self, workflow_id: str, job_id: str, attempt: int, position: int, errors: int) -> None:
        """Does a task."""

    def check(self, workflow_id: str, scene_id: str, is_long: bool) -> None:
        """Checks a scene."""


_host: Host | None = None


def use(host: Host | None) -> None:
    """Sets the host of all workflows of this process."""
    global _host
    _host = host


def _present() -> Host:
    assert _host is not None, "workflows run within a Runtime"
    return _host


def _id() -> str:
    found = DBOS.workflow_id
    assert found is not None
    return found


@DBOS.workflow(name="job", max_recovery_attempts=JOB_EXECUTORS)
def job(job_id: str, attempt: int) -> None:
    """Conducts a job."""
    _present().conduct(_id(), job_id, attempt)


@DBOS.workflow(name="task", max_recovery_attempts=LOST_EXECUTORS - 1)
def task(job_id: str, attempt: int, position: int, errors: int) -> None:
    """Does a task. It has no steps: done again, it finds the artifact."""
    _present().work(_id(), job_id, attempt, position, errors)


@DBOS.workflow(name="check", max_recovery_attempts=LOST_EXECUTORS - 1)
def check(scene_id: str, is_long: bool) -> None:
    """Checks an uploaded scene."""
    _present().check(_id(), scene_id, is_long)
