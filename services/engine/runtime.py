"""A process of the service that runs work: started, and stopped without losing anything."""

from __future__ import annotations

import os
import time
from collections import Counter
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import structlog
from sqlalchemy.exc import DBAPIError

from schemas.job import JobSpec
from schemas.problem import ExitCode, Problem
from services.clock import iso
from services.database import Database, open_database
from services.engine import checks, flow, queues, states, steering, system
from services.engine.child import resolve
from services.engine.children import ChildOptions, Hooks
from services.engine.claims import Claims
from services.engine.housekeeping import Housekeeping
from services.engine.jobs import Jobs
from services.engine.liveness import Liveness
from services.engine.rooms import KERNELS, Scratch
from services.engine.runner import DurableRunner
from services.engine.states import Abandoned, Cancelled, Claim
from services.engine.task_states import Place, Tasks
from services.engine.work import Worker
from services.problems import document_of, summary_of
from services.settings import Settings
from services.sources import sweep_sources
from services.webhooks.addresses import networks_of
from services.webhooks.deliverer import Deliverer
from stages.tasks import ROLES, Role

if TYPE_CHECKING:
    from services.measured import Measured
    from services.registry import Registry
    from services.scenes import Scenes
    from services.storage import Storage

OUTAGES = 20
"""A job that meets so many outages of the database fails."""
STORE_PATIENCE_SECONDS = 600.0
"""How long work under way waits for an object store that does not answer; then it fails, to be tried again."""

log = structlog.get_logger(__name__)


@dataclass(frozen=True)
class Bodies:
    """What the work is, as `module:function`; tests put others in their place.

    Attributes:
        job: Runs the pipeline of a job.
        make: Makes a task's artifact, in a child process.
        inspect: Checks a scene, in a child process.
        sandbox: Shuts a child process in; empty: left open.
        retry_seconds: Delay before a failed task is tried again.
    """

    job: str = "services.pipeline:run_job"
    make: str = "stages.bodies:make"
    inspect: str = "services.intake:inspect"
    sandbox: str = "services.sandbox:enter"
    retry_seconds: float = 2.0


@dataclass(frozen=True)
class Parts:
    """What the work is done with."""

    storage: Storage
    registry: Registry
    measured: Measured
    scenes: Scenes


def open_parts(settings: Settings, database: Database, jobs: Jobs) -> Parts:
    """The parts that the settings name."""
    from services.measured import Measured
    from services.registry import open_registry
    from services.scenes import Scenes
    from services.storage import open_storage

    storage = open_storage(settings, STORE_PATIENCE_SECONDS)
    registry = open_registry(database, storage.blobs, settings)
    return Parts(storage, registry, Measured(database), Scenes(database, storage.blobs, jobs))


class Runtime:
    """Runs jobs and tasks in this process, of which there is one `Runtime`.

    Args:
        settings: Of the service.
        roles: What it does.
        bodies: What the work is.
        parts: What it is done with; None: what the settings name.
    """

    def __init__(
        self,
        settings: Settings,
        roles: Sequence[Role] = ROLES,
        bodies: Bodies = Bodies(),
        parts: Parts | None = None,
    ) -> None:
        self.settings, self.roles = settings, tuple(roles)
        self._bodies, self._parts = bodies, parts
        self._claims = Claims()
        self._outages: Counter[str] = Counter()
        self._slots = queues.slots(settings, self.roles)
        self._claimable: dict[str, int] = {}
        self._stack = ExitStack()

    @property
    def executor(self) -> str:
        """Id of this process life."""
        return self._liveness.executor

    def start(self) -> None:
        """Begins to take work.

        Raises:
            Problem: The database or the store cannot be used.
        """
        self._database = open_database(self.settings.database_url)
        self._stack.callback(self._database.close)
        self._jobs = Jobs(self.settings, self._database)
        self._stack.callback(self._jobs.close)
        self._parts = self._parts or open_parts(self.settings, self._database, self._jobs)
        self._tasks = Tasks(self._database, self._jobs.client, self._bodies.retry_seconds)
        children: dict[Role, int] = {role: self._slots[role] for role in self.roles if role != "jobs"}
        options = self._child_options(sum(children.values()))
        self._worker = Worker(self.settings, self._parts.storage, self._tasks, self._claims, options, children)
        self._liveness = Liveness(self.settings, self._database, self._claims, self._slots, self._see_to_adrift)
        self._housekeeping = Housekeeping(
            self.settings, self._database, self._jobs.client, self._parts.storage, conducts="jobs" in self.roles
        )
        self._deliverer = Deliverer(self._database, networks_of(self.settings.webhook_networks))
        self._liveness.beat()  # before anything can be claimed
        self._launch()
        self._liveness.start()
        self._housekeeping.start()
        if "jobs" in self.roles:
            self._deliverer.start()
        log.info("taking work", executor=self.executor, roles=self.roles)

    def stop(self) -> None:
        """Takes no more work, finishes tasks under way within `drain_seconds`, and leaves the rest to others."""
        from dbos import DBOS

        self._claimable.clear()
        self._claims.draining.set()
        self._housekeeping.stop()
        end = time.monotonic() + self.settings.drain_seconds
        while self._claims.held() and time.monotonic() < end:
            time.sleep(0.05)
        self._claims.lose(self._claims.held())
        self._worker.stop()
        end = time.monotonic() + 3.0
        while self._claims.held() and time.monotonic() < end:
            time.sleep(0.02)
        self._deliverer.stop()  # after the jobs that ended: they are news
        self._liveness.stop()
        DBOS.destroy(workflow_completion_timeout_sec=0)
        flow.use(None)
        self._stack.close()
        log.info("stopped", executor=self.executor)

    def conduct(self, workflow_id: str, job_id: str, attempt: int) -> None:
        """See `flow.Host`."""
        claim = Claim(workflow_id, self.executor)
        with self._claims.hold(workflow_id), structlog.contextvars.bound_contextvars(job_id=job_id):
            row = states.begin_job(self._database, claim, job_id, attempt)
            if row is None:
                return
            structlog.contextvars.bind_contextvars(request_id=row.request_id)
            try:
                state, problem, result = "succeeded", None, self._run(claim, row)
            except Cancelled:
                state, problem, result = "cancelled", None, None
            except Problem as found:
                state, problem, result = "failed", document_of(found), None
            except Exception as error:
                if isinstance(error, DBAPIError) and states.is_outage(error) and self._outages[job_id] < OUTAGES:
                    # It goes back to the queue when the database answers again, and goes on where it was.
                    self._outages[job_id] += 1
                    log.warning("the database went away under the job", error=type(error).__name__)
                    raise Abandoned(workflow_id) from None
                log.exception("the job failed unexpectedly")
                unexpected = Problem(
                    f"Something unexpected happened ({summary_of(error)}).",
                    "The service's log has the details under the job's id; please report them.",
                    ExitCode.TRY_AGAIN,
                )
                state, problem, result = "failed", document_of(unexpected), None
            states.end_job(self._database, claim, job_id, attempt, state, problem=problem, result=result)
            log.info("job ended", state=state)

    def work(self, workflow_id: str, job_id: str, attempt: int, position: int, errors: int) -> None:
        """See `flow.Host`."""
        claim = Claim(workflow_id, self.executor)
        with self._claims.hold(workflow_id), structlog.contextvars.bound_contextvars(job_id=job_id):
            self._worker.do(claim, Place(job_id, attempt, position), errors)

    def check(self, workflow_id: str, scene_id: str, is_long: bool) -> None:
        """See `flow.Host`."""
        assert self._parts is not None
        claim = Claim(workflow_id, self.executor)
        hooks = Hooks() if is_long else Hooks(tick=checks.Turn(self._database, self.settings.check_turn).tick)
        with self._claims.hold(workflow_id), structlog.contextvars.bound_contextvars(scene_id=scene_id):
            try:
                self._worker.check(claim, scene_id, self._parts.scenes, hooks)
            except checks.TurnOver:
                self._jobs.check_longer(workflow_id)
            self._jobs.check_next(scene_id)

    def _see_to_adrift(self) -> None:
        for job_id in states.end_adrift(self._database):
            log.error("a job that nobody conducted was ended", job_id=job_id)
        checks.see_to_adrift(self._database, self._jobs)

    def _run(self, claim: Claim, row: Any) -> dict[str, Any]:
        from services.pipeline import JobContext

        assert self._parts is not None
        parts = self._parts
        spec = JobSpec.model_validate(row.spec)
        scenes = parts.scenes.many([use.scene for use in spec.scenes])
        runner = DurableRunner(
            claim,
            row.id,
            row.attempt,
            row.submitted_by,
            database=self._database,
            tasks=self._tasks,
            claims=self._claims,
            storage=parts.storage,
            registry=parts.registry,
            measured=parts.measured,
        )
        if row.state != "running":
            raise Cancelled(row.id)
        result: dict[str, Any] = resolve(self._bodies.job)(spec, scenes, runner, JobContext(row.id, iso(row.created)))
        skipped = dict(runner.progress.skips)
        states.note(self._database, row.id, skipped=skipped)
        return result

    def _launch(self) -> None:
        from dbos import DBOS, DBOSConfig, DBOSPortableJSONSerializer

        flow.use(self)
        self._claimable.update(self._slots)
        config = DBOSConfig(
            name=system.APPLICATION,
            system_database_url=system.engine_url(self._database.url),
            application_version=system.VERSION,
            executor_id=self.executor,
            serializer=DBOSPortableJSONSerializer(),
            run_migrations=False,
            sys_db_pool_size=8,
            max_executor_threads=sum(self._slots.values()) + 8,
            log_level="WARNING",
        )
        DBOS(config=config)
        DBOS.listen_queues(list(self._slots))
        DBOS.launch()
        steering.steer(self._database, self._claimable)

    def _child_options(self, children: int) -> ChildOptions:
        self._scratch = Scratch(self.settings.state.resolve() / "work")
        self._stack.callback(self._scratch.close)
        sweep_sources(self.settings.cache_folder, time.time())
        return ChildOptions(
            make=self._bodies.make,
            inspect=self._bodies.inspect,
            sandbox=self._bodies.sandbox,
            scratch=self._scratch.folder,
            kernels=self._scratch.folder.parent / KERNELS,
            memory_bytes=self.settings.task_bytes or None,
            threads=max(1, len(os.sched_getaffinity(0)) // max(1, children)),
        )
