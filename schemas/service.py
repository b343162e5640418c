"""What the service answers: scenes, jobs, data sets, published versions, keys, workers. Times are ISO 8601, UTC."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from schemas.job import JobKind, JobSpec, JobState, Priority, TaskState
from schemas.limits import LIMITS
from schemas.measurement import Measurement

Scope = Literal["read", "submit", "publish", "admin"]
SCOPES: tuple[Scope, ...] = ("read", "submit", "publish", "admin")

SceneState = Literal["checking", "accepted", "rejected"]
EventKind = Literal["state", "stage", "task", "log"]

Sha256 = str


class _Record(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class ProblemDocument(BaseModel):
    """`application/problem+json` (RFC 9457).

    Attributes:
        type: `/v1/problems/SLUG`, where the problem is explained.
        title: What is wrong, the same for every problem of the type.
        status: HTTP status.
        detail: What is wrong this time.
        remedy: What to do about it.
        instance: Path of the request.
        request_id: As in the logs.
        errors: Places in the request and what is wrong there.
    """

    model_config = ConfigDict(extra="allow")

    type: str
    title: str
    status: int
    detail: str = ""
    remedy: str = ""
    instance: str = ""
    request_id: str = ""
    errors: tuple[dict[str, Any], ...] = ()


class FileRef(_Record):
    """A file by content."""

    sha256: Sha256 = Field(pattern=r"^[0-9a-f]{64}$")
    bytes: int = Field(ge=0)


class SceneRecord(_Record):
    """An uploaded scene.

    Attributes:
        id: `scn_` and 32 hex digits, from the content: the same files give the same id.
        digest: Hex sha256 over root, names and hashes of the files.
        name: What its owner calls it.
        root: The file that is opened.
        files: Relative path -> size and hash.
        bytes: Of all files.
        state: Jobs take accepted scenes only.
        problem: Why it was rejected.
        facts: What was found in it: triangles, prims, views, warnings.
        created: When it came.
    """

    id: str
    digest: Sha256
    name: str
    root: str
    files: dict[str, FileRef]
    bytes: int
    state: SceneState
    problem: ProblemDocument | None = None
    facts: dict[str, Any] | None = None
    created: str


class StageProgress(_Record):
    """How far a stage of a job is: numbers of tasks, and seconds still to go where that can be told."""

    stage: str
    total: int = 0
    done: int = 0
    skipped: int = 0
    running: int = 0
    queued: int = 0
    quarantined: int = 0
    fraction: float = 0.0
    eta_seconds: float | None = None


class JobRecord(_Record):
    """A job.

    Attributes:
        id: `job_` and 24 hex digits.
        kind: What it makes.
        name: Bundle that it publishes.
        spec: As submitted, with the version that it begins with in the place of its alias.
        state: Where it is.
        attempt: 1, and one more for each retry.
        stage: Stage under way.
        stages: Progress of all stages begun.
        fraction: Of the whole job, in [0, 1].
        eta_seconds: Seconds still to go, estimated from the tasks done; None while nothing is known.
        priority: Its class in the queues.
        created: When it was submitted.
        started: When it left the queue.
        finished: When it ended.
        submitted_by: Id of the key.
        request_id: Of the request that submitted it.
        problem: Why it failed.
        result: Reference of the published version, score, quarantined tasks, data set, report: what its kind makes.
        skipped: What was not done because it did not need to be, with counts.
    """

    id: str
    kind: JobKind
    name: str | None
    spec: JobSpec
    state: JobState
    attempt: int
    stage: str | None
    stages: tuple[StageProgress, ...] = ()
    fraction: float = 0.0
    eta_seconds: float | None = None
    priority: Priority
    created: str
    started: str | None = None
    finished: str | None = None
    submitted_by: str
    request_id: str | None = None
    problem: ProblemDocument | None = None
    result: dict[str, Any] | None = None
    skipped: dict[str, int] = {}


class TaskRecord(_Record):
    """A task of a job: one artifact.

    Attributes:
        stage: Stage.
        name: What a user calls it.
        artifact: `stage/key`.
        state: Where it is.
        progress: In [0, 1] while it runs.
        note: How it goes.
        executor: Process that runs or ran it.
        seconds: How long it took.
        problem: Why it was quarantined.
    """

    stage: str
    name: str
    artifact: str
    state: TaskState
    progress: float | None = None
    note: str | None = None
    executor: str | None = None
    started: str | None = None
    finished: str | None = None
    seconds: float | None = None
    problem: ProblemDocument | None = None


class EventRecord(_Record):
    """Something that happened in a job; `number` rises by one from 1 and is the id of the server-sent event."""

    number: int
    at: str
    kind: EventKind
    data: dict[str, Any]


class ShardRef(_Record):
    """A label shard of a data set: rows of one view."""

    scene: str
    scene_digest: Sha256
    view: str
    artifact: str
    sha256: Sha256
    bytes: int


class DatasetRecord(_Record):
    """Label shards that a training can learn from."""

    id: str
    job_id: str | None
    created: str
    settings: dict[str, Any]
    shards: tuple[ShardRef, ...]


class VersionRecord(_Record):
    """A published version.

    Attributes:
        name: Name of the bundle.
        version: Semantic version.
        digest: Hex sha256 over the names and contents of the files.
        score: Geometric mean over held-out views and budgets of the bundle's squared error over VKB's.
        evaluation: What the score was measured on.
        parity: Agreement of torch, ONNX and GLSL.
        provenance: Scenes by hash, code version, seed, machine.
        files: Name -> size and hash; `/v1/blobs/sha256/HASH` serves them.
        statement: The exact text that is signed: canonical JSON with name, version, digest and files.
        signature: ed25519 over the statement's UTF-8 bytes, base64.
        public_key: Raw ed25519 public key, base64.
        aliases: That mean this version now.
        created: When it was published.
        job_id: Job that published it.
    """

    name: str
    version: str
    digest: Sha256
    score: float | None
    evaluation: dict[str, Any]
    parity: dict[str, Any]
    provenance: dict[str, Any]
    files: dict[str, FileRef]
    statement: str
    signature: str
    public_key: str
    aliases: tuple[str, ...] = ()
    created: str
    job_id: str | None = None


class HandoverRecord(_Record):
    """A signing key names the one that follows it.

    Attributes:
        statement: The exact text that is signed: canonical JSON with both public keys and the time.
        signature: ed25519 of the old key over the statement's UTF-8 bytes, base64.
    """

    statement: str
    signature: str


class PointerRecord(_Record):
    """What an alias means now, for clients to believe until it expires.

    Attributes:
        statement: The exact text that is signed: canonical JSON with name, selector, version, digest, serial, and when
            it was issued and expires, in seconds since 1970. The serial rises with each move of the alias.
        signature: ed25519 over the statement's UTF-8 bytes, base64.
        public_key: Raw ed25519 public key, base64.
        handovers: How this key followed earlier ones, oldest first.
    """

    statement: str
    signature: str
    public_key: str
    handovers: tuple[HandoverRecord, ...] = ()


class MoveRecord(_Record):
    """One move of an alias: from which version to which, when, by whom and why."""

    alias: str
    before: str | None
    after: str
    at: str
    who: str
    why: str


class ModelRecord(_Record):
    """A name in the registry."""

    name: str
    latest: str
    aliases: dict[str, str]
    versions: int


class MeasurementRecord(_Record):
    """A measurement, and where it comes from."""

    id: int
    created: str
    job_id: str | None
    model: str | None
    scene_digest: Sha256
    measurement: Measurement


class JobBounds(_Record):
    """What the jobs of a key may ask for; None is what the service is configured for (`DIAPHANE_JOB_*`).

    Attributes:
        job_pixels: Pixels of all views of a job together.
        job_steps: Optimiser steps of a job.
        jobs: Jobs that have not ended.
    """

    job_pixels: int | None = Field(default=None, ge=1, le=2**53)
    job_steps: int | None = Field(default=None, ge=1, le=LIMITS.steps)
    jobs: int | None = Field(default=None, ge=1, le=2**31 - 1)


class KeyRecord(_Record):
    """An API key without its secret."""

    id: str
    name: str
    scopes: tuple[Scope, ...]
    created: str
    expires: str | None = None
    revoked: str | None = None
    last_used: str | None = None
    bounds: JobBounds = JobBounds()


class QueueRecord(_Record):
    """How much waits for a role, or, as `check`, how many uploads wait for their check."""

    role: str
    queued: int
    running: int


class ExecutorRecord(_Record):
    """A process that runs work."""

    id: str
    host: str
    roles: tuple[str, ...]
    last_seen: str
    alive: bool
