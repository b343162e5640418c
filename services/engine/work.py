"""A task from claim to artifact: what the parent of a body does.

The parent talks to database and store; the body, in a child process, reads what lies ready in local folders.
"""

from __future__ import annotations

import shutil
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import structlog
from sqlalchemy.exc import DBAPIError

from renderer.gate import ended
from schemas.problem import Problem
from services.engine import problems
from services.engine.children import Assignment, Child, ChildOptions, Hooks, Lost, Pool, Spawner
from services.engine.claims import Claims
from services.engine.events import Event
from services.engine.states import Abandoned, Claim
from services.engine.task_states import Begun, Place, Tasks
from services.problems import document_of, summary_of
from services.settings import Settings
from services.sources import materialise
from stages.catalogue import STAGES
from stages.store import MissingArtifact
from stages.tasks import Role, Task

if TYPE_CHECKING:
    from services.scenes import Scenes
    from services.storage import Storage

REPORT_SECONDS = 1.0
LINES_PER_TASK = 2000
CHECK_TRIES = 2

log = structlog.get_logger(__name__)


@dataclass
class _Reporter:
    """Collects what a body says, and writes it about once a second."""

    tasks: Tasks
    claim: Claim
    place: Place
    task: Task
    values: dict[str, Any] = field(default_factory=dict)
    lines: list[str] = field(default_factory=list)
    count: int = 0
    written: float = field(default_factory=time.monotonic)

    def progress(self, fraction: float, note: str) -> None:
        """See `Hooks`."""
        self.values = {"progress": min(1.0, max(0.0, fraction)), "note": note or None}

    def line(self, text: str) -> None:
        """See `Hooks`."""
        self.count += 1
        if self.count < LINES_PER_TASK:
            self.lines.append(text)
        elif self.count == LINES_PER_TASK:
            self.lines.append("(further output is left out)")

    def tick(self) -> None:
        """See `Hooks`; a report that the database does not take is made later."""
        if time.monotonic() - self.written < REPORT_SECONDS or not (self.values or self.lines):
            return
        self.written = time.monotonic()
        with suppress(DBAPIError):
            self.tasks.report(self.claim, self.place, self.values, self.events())
            self.values, self.lines = {}, []

    def events(self) -> Sequence[Event]:
        """The output that was not written yet."""
        if not self.lines:
            return []
        where = {"stage": self.task.stage, "name": self.task.name}
        return [("log", {**where, "text": "\n".join(self.lines)})]


class Worker:
    """Does tasks.

    Args:
        settings: Of the service.
        storage: Artifacts and blobs.
        tasks: Transitions of tasks.
        claims: What runs here.
        options: How children are set up.
        slots: Children of each role.
    """

    def __init__(
        self,
        settings: Settings,
        storage: Storage,
        tasks: Tasks,
        claims: Claims,
        options: ChildOptions,
        slots: Mapping[Role, int],
    ) -> None:
        self._settings, self._storage, self._tasks, self._claims = settings, storage, tasks, claims
        self._options, self._spawner = options, Spawner()
        self._pools = {role: Pool(options, self._spawner, role, count) for role, count in slots.items()}

    def stop(self) -> None:
        """Ends all child processes."""
        for pool in self._pools.values():
            pool.stop()

    def do(self, claim: Claim, place: Place, errors: int) -> None:
        """Makes the artifact of a task, or says why not.

        Args:
            claim: Of the workflow.
            place: The task.
            errors: How often it failed before.

        Raises:
            Abandoned: The claim was lost.
        """
        begun = self._tasks.begin(claim, place, errors)
        if begun is None:
            return
        task = begun.task
        title = f"{task.stage} {task.name}"
        reporter = _Reporter(self._tasks, claim, place, task)
        try:
            if self._storage.store.holds(task.artifact):
                self._tasks.end(claim, place, "done" if begun.again else "skipped", None)
                return
            note = self._make(claim, begun, title, reporter)
        except Lost:
            raise Abandoned(claim.workflow_id) from None
        except MissingArtifact as missing:
            self._tasks.wait_for(claim, place, missing.artifact, errors)
        except Problem as problem:
            final = problem.code in problems.FINAL_CODES
            self._tasks.fail(claim, place, problem, errors, reporter.events(), final=final)
        except problems.TaskError as error:
            log.warning("task failed", task=title, reason=error.problem.title, tries=errors + 1)
            crashed = isinstance(error, problems.Crashed)
            self._tasks.fail(claim, place, error.problem, errors, reporter.events(), final=False, crashed=crashed)
        except Exception as error:  # a full disk, a store that does not answer
            log.exception("task failed", task=title, tries=errors + 1)
            unexpected = problems.failed(title, summary_of(error)).problem
            self._tasks.fail(claim, place, unexpected, errors, reporter.events(), final=False)
        else:
            self._tasks.end(claim, place, "done", note, reporter.events())

    def check(self, claim: Claim, scene_id: str, scenes: Scenes, hooks: Hooks) -> None:
        """Looks into an uploaded scene, in a process of its own that sees nothing else.

        Args:
            claim: Of the workflow.
            scene_id: The scene.
            scenes: All of them.
            hooks: Told what happens; what they raise ends the check, and nothing is written down.

        Raises:
            Abandoned: The claim was lost.
        """
        from stages.plan import source_of_scene

        record = scenes.get(scene_id)
        if record.state != "checking":
            return
        source = source_of_scene(record)
        folder = materialise(source, self._storage.blobs, self._settings.cache_folder)
        request = {"source": source.digest, "root": source.root}
        assignment = Assignment(subject=source.digest, sources={source.digest: folder})
        options = replace(self._options, memory_bytes=self._settings.check_bytes)
        seconds = self._settings.check_seconds
        # One whose worker died at the end of its turn may run again beside the longer one that it queued.
        name = f"check-{scene_id}-{claim.workflow_id.rpartition('/')[2]}"
        for left in reversed(range(CHECK_TRIES)):
            child = Child(options, self._spawner, name)
            self._claims.on_loss(claim.workflow_id, child.lose)
            try:
                answer = child.call(f"the check of {record.name}", request, seconds, hooks, assignment)
            except Lost:
                raise Abandoned(claim.workflow_id) from None
            except Problem as problem:
                scenes.resolve_check(scene_id, None, document_of(problem))
            except problems.TimedOut:
                scenes.resolve_check(scene_id, None, document_of(ended(source.root, timed_out=True)))
            except problems.TaskError:
                if left:  # its child may have been a bystander: the machine may be short of memory for other reasons
                    continue
                scenes.resolve_check(scene_id, None, document_of(ended(source.root, timed_out=False)))
            else:
                scenes.resolve_check(scene_id, answer["facts"], None)
            finally:
                self._claims.on_loss(claim.workflow_id, None)
                child.stop()
            return

    def _make(self, claim: Claim, begun: Begun, title: str, reporter: _Reporter) -> str:
        """Has the artifact made and stored; what it took, in words."""
        store, task = self._storage.store, begun.task
        assignment = self._assignment(task, begun.owner)
        seconds = self._settings.train_seconds if task.stage == "train" else self._settings.task_seconds
        request = {"task": task.model_dump(mode="json")}
        hooks = Hooks(reporter.progress, reporter.line, reporter.tick)
        with self._pools[STAGES[task.stage].role].child() as child:
            self._claims.on_loss(claim.workflow_id, child.lose)
            try:
                answer = child.call(title, request, seconds, hooks, assignment)
                store.adopt(child.room.artifact(task.address), task.artifact)
            finally:
                self._claims.on_loss(claim.workflow_id, None)
        if assignment.checkpoints is not None:
            shutil.rmtree(assignment.checkpoints, ignore_errors=True)
        store.push(task.address)
        usage = answer["usage"]
        return f"{usage['cpu_seconds']:.1f} s CPU, {usage['peak_bytes'] / 2**20:.0f} MiB"

    def _assignment(self, task: Task, owner: str) -> Assignment:
        """What the process of a task sees: what the task reads, and nothing else."""
        store, checkpoints = self._storage.store, None
        sources = [source for source in (task.scene, task.bundle) if source is not None and source.files]
        subject = None if task.scene is None else task.scene.digest
        if task.stage == "train":
            subject, checkpoints = task.artifact, store.checkpoints / task.address.key
            checkpoints.mkdir(parents=True, exist_ok=True)
        return Assignment(
            subject=subject,
            owner=owner,
            needs={need: store.fetch(need) for need in task.needs},
            sources={s.digest: materialise(s, self._storage.blobs, self._settings.cache_folder) for s in sources},
            checkpoints=checkpoints,
        )
