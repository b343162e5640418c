"""The pipeline's runner for jobs: a stage's tasks are queued for the workers, then waited for.

A job that is taken over by another process runs the pipeline again from its beginning. Everything here gives the same
answer the second time: tasks have rows, steps have remembered results.
"""

from __future__ import annotations

import json
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, cast

import structlog

from evaluation.progress import Stage
from schemas.problem import ExitCode, Problem
from services.database import Database
from services.engine import states, system
from services.engine.claims import Claims
from services.engine.states import Abandoned, Claim
from services.engine.task_states import Tasks
from stages.catalogue import STAGES
from stages.store import MissingArtifact, StoreAway
from stages.tasks import FACTS, JsonFacts, StageName, Task

if TYPE_CHECKING:
    from services.measured import Measured
    from services.registry import Registry
    from services.storage import Storage

CHUNK = 200
FIRST_WAIT_SECONDS, LONGEST_WAIT_SECONDS = 0.05, 1.0
MEND_SECONDS = 1.0
STEP_TRIES = 3
REMAKE_TRIES = 5

log = structlog.get_logger(__name__)


class JobProgress:
    """The pipeline's notes become events of the job.

    Args:
        database: The database.
        job_id: The job.
        once: Runs something unless an earlier run of the job did.
    """

    def __init__(self, database: Database, job_id: str, once: Callable[[str, Callable[[], None]], None]) -> None:
        self.skips: Counter[str] = Counter()
        self._database, self._job_id, self._once = database, job_id, once

    @contextmanager
    def stage(self, name: str, total: int) -> Iterator[Stage]:
        """See `evaluation.progress.Progress`; the runner itself tells the stages."""
        yield _NoStage()

    def note(self, text: str) -> None:
        """See `evaluation.progress.Progress`."""
        self._once("note", lambda: states.note(self._database, self._job_id, ("log", {"text": text})))

    def skipped(self, what: str, count: int = 1) -> None:
        """See `evaluation.progress.Progress`."""
        self.skips[what] += count


class _NoStage:
    def advance(self, n: int = 1, note: str = "") -> None:
        """See `evaluation.progress.Stage`."""


class DurableRunner:
    """See `services.runner.Runner`.

    Args:
        claim: Of the workflow that conducts the job.
        job_id: The job.
        attempt: Which attempt it is.
        who: Id of the key that submitted the job.
        database: The database.
        tasks: Transitions of tasks.
        claims: What runs in this process.
        storage: Where artifacts and blobs lie.
        registry: Where bundles are published.
        measured: Where measurements are kept.
    """

    def __init__(
        self,
        claim: Claim,
        job_id: str,
        attempt: int,
        who: str,
        *,
        database: Database,
        tasks: Tasks,
        claims: Claims,
        storage: Storage,
        registry: Registry,
        measured: Measured,
    ) -> None:
        self.job_id: str | None = job_id
        self.who: str | None = who
        self.store, self.blobs = storage.store, storage.blobs
        self.registry, self.measured = registry, measured
        self.progress = JobProgress(database, job_id, self._once)
        self._claim, self._id, self._attempt = claim, job_id, attempt
        self._database, self._tasks, self._claims = database, tasks, claims

    def map(self, stage: StageName, tasks: Sequence[Task]) -> list[JsonFacts | None]:
        """See `services.runner.Runner`."""
        if not tasks:
            return []
        told: dict[str, Any] = {"stage": stage, "attempt": self._attempt}
        begun = {**told, "what": "begun", "tasks": len(tasks)}
        self._once(f"begin {stage}", lambda: states.note(self._database, self._id, ("stage", begun), stage=stage))
        facts: dict[str, JsonFacts | None] = {}
        for _ in range(REMAKE_TRIES):
            self._place(tasks)
            self._join(stage)
            facts, missing = self._read(stage, tasks)
            if not missing:
                break
            for artifact in missing:
                self._tasks.remake(self._claim, self._id, artifact)
        else:
            raise Problem(
                f"Artifacts of the stage {stage} disappear as soon as they are made.",
                "Look into the store: is its disk failing, or is something else removing files?",
                ExitCode.TRY_AGAIN,
            )
        if all(found is None for found in facts.values()):
            self._refuse(stage)
        self._count_skips(stage, tasks)
        skips = dict(self.progress.skips)
        ended = {**told, "what": "ended", "quarantined": sum(found is None for found in facts.values())}
        self._once(f"end {stage}", lambda: states.note(self._database, self._id, ("stage", ended), skipped=skips))
        return [facts[task.name] for task in tasks]

    def _refuse(self, stage: StageName) -> None:
        """Ends the job with the reason of a task, where every task of a stage failed.

        Raises:
            Problem: Always.
        """
        document = self._tasks.first_problem(self._id, stage)
        detail = document.detail or document.title
        raise Problem(f"The stage {stage} failed: {detail}", document.remedy, ExitCode.CHECK_FAILED)

    def step(self, name: str, body: Callable[[], Any]) -> Any:
        """See `services.runner.Runner`; a problem is remembered as well as a result.

        An artifact that the step needs and that is gone is made again.
        """
        outcome = self._once(name, lambda: _outcome(lambda: self._with_artifacts(body)))
        if "problem" in outcome:
            title, remedy, code = outcome["problem"]
            raise Problem(title, remedy, ExitCode(code))
        return outcome["value"]

    def _once(self, name: str, body: Callable[[], Any]) -> Any:
        """Runs a step, or gives its result if the job has run it before."""
        self._check()
        try:
            return system.once(name, lambda: self._try(name, body))
        except system.Ended:
            raise Abandoned(self._claim.workflow_id) from None

    def _try(self, name: str, body: Callable[[], Any]) -> Any:
        for left in reversed(range(STEP_TRIES)):
            try:
                return body()
            except Exception:
                if not left:
                    raise
                log.exception("step failed and is tried again", step=name)
                time.sleep(1.0)
        raise AssertionError("the last try returns or raises")

    def _with_artifacts(self, body: Callable[[], Any]) -> Any:
        for _ in range(REMAKE_TRIES):
            try:
                return body()
            except MissingArtifact as missing:
                log.warning("a step needs an artifact that is gone", artifact=missing.artifact)
                self._tasks.remake(self._claim, self._id, missing.artifact)
                self._join(cast("StageName", missing.artifact.partition("/")[0]))
        return body()

    def _check(self) -> None:
        """Whether the job goes on, here."""
        if self._claims.draining.is_set():
            raise Abandoned(self._claim.workflow_id)
        self._claims.check(self._claim.workflow_id)
        states.check_running(self._database, self._claim, self._id)

    def _place(self, tasks: Sequence[Task]) -> None:
        for start in range(0, len(tasks), CHUNK):
            self._check()
            chunk = [(task, self.store.holds(task.artifact)) for task in tasks[start : start + CHUNK]]
            self._tasks.place(self._claim, self._id, chunk)

    def _join(self, stage: StageName) -> None:
        wait, mended = FIRST_WAIT_SECONDS, time.monotonic()
        while self._tasks.open(self._id, stage):
            self._check()
            if time.monotonic() - mended > MEND_SECONDS:
                self._tasks.mend(self._claim, self._id)
                mended = time.monotonic()
            if self._claims.draining.wait(wait):
                raise Abandoned(self._claim.workflow_id)
            wait = min(LONGEST_WAIT_SECONDS, 1.3 * wait)

    def _read(self, stage: StageName, tasks: Sequence[Task]) -> tuple[dict[str, JsonFacts | None], list[str]]:
        """Facts by name of task, and artifacts that were there and are gone."""
        ends = self._tasks.states(self._id, stage)
        facts: dict[str, JsonFacts | None] = {}
        missing: list[str] = []
        for task in tasks:
            facts[task.name] = None
            if ends[task.name] in ("done", "skipped"):
                try:
                    facts[task.name] = json.loads(self.store.read(task.artifact, FACTS))
                except MissingArtifact as error:
                    missing.append(error.artifact)
        self._check()
        return facts, missing

    def _count_skips(self, stage: StageName, tasks: Sequence[Task]) -> None:
        ends = self._tasks.states(self._id, stage)
        for task in tasks:
            if ends[task.name] == "skipped":
                self.progress.skipped(STAGES[stage].known(task))


def _outcome(body: Callable[[], Any]) -> dict[str, Any]:
    try:
        return {"value": body()}
    except StoreAway:  # no result of the step: it is tried again
        raise
    except Problem as problem:
        return {"problem": [problem.title, problem.remedy, int(problem.code)]}
