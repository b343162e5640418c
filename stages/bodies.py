"""From a task to its artifact."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path

from schemas.problem import ExitCode, Problem
from stages.catalogue import STAGES
from stages.desk import Desk, FolderOf, save_facts
from stages.stage import module_of
from stages.store import Store
from stages.tasks import Report, Task

_desks: dict[Path, Desk] = {}


def make(task: Task, store: Store, folder_of: FolderOf, report: Report) -> None:
    """Makes a task's artifact, in a process that does one task after the other: the scene stays on the GPU.

    Args:
        task: What to make.
        store: Where artifacts lie on this machine.
        folder_of: Where sources lie on this machine.
        report: Told how far it is.

    Raises:
        Problem: The input cannot be used.
        MissingArtifact: Something that the task reads is not there, or damaged.
    """
    if store.root not in _desks:
        _desks[store.root] = Desk(store, folder_of)
    make_at(_desks[store.root], task, report)


def make_at(desk: Desk, task: Task, report: Report) -> None:
    """Makes a task's artifact, unless it is there already.

    The modules are imported when they are first needed: a worker loads only what its role uses.

    Raises:
        Problem: The input cannot be used.
        MissingArtifact: Something that the task reads is not there, or damaged.
    """
    if desk.store.get(task.address) is not None:
        return
    stage = STAGES[task.stage]
    if task.version != stage.version:
        raise Problem(
            f"The task {task.stage} {task.name} is for another version of Diaphane than this process runs.",
            "Run the same version on all workers; a retry of the job then continues.",
            ExitCode.TRY_AGAIN,
        )
    made = import_module(module_of(task.stage))
    with desk.store.put(task.address) as folder:
        save_facts(folder, made.make(desk, task, stage.params_of(task), folder, report))
