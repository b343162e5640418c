"""What the routes take and answer beside the records of `schemas.service`."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, StringConstraints

from schemas.limits import LIMITS
from schemas.service import (
    DatasetRecord,
    EventRecord,
    ExecutorRecord,
    JobBounds,
    JobRecord,
    KeyRecord,
    MeasurementRecord,
    ModelRecord,
    MoveRecord,
    QueueRecord,
    SceneRecord,
    Scope,
    TaskRecord,
    VersionRecord,
)
from schemas.webhook import WEBHOOK_EVENTS, DeliveryRecord, WebhookEvent, WebhookRecord
from services.api.parts import PRINTED
from services.problems import ProblemType

HASHES_PER_REQUEST = 4096

Hash = Annotated[str, StringConstraints(pattern=r"^[0-9a-f]{64}$")]
Title = Annotated[str, StringConstraints(min_length=1, max_length=200, pattern=PRINTED)]
FilePath = Annotated[str, StringConstraints(min_length=1, max_length=512, pattern=PRINTED)]
Reason = Annotated[str, StringConstraints(min_length=1, max_length=1000, pattern=PRINTED)]
VersionOrAlias = Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9][A-Za-z0-9.-]{0,39}$")]


class _Model(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class NewUpload(_Model):
    """A file that is to be uploaded."""

    sha256: Hash
    bytes: int = Field(ge=0, le=LIMITS.upload_bytes)


class UploadState(_Model):
    """How far an upload is; a file that is there already has no upload, and no id.

    Attributes:
        id: Names the upload.
        received: Where the next part begins.
        bytes: Of the whole file.
        part_bytes: Of a part at most.
        complete: Whether the file is there.
    """

    id: str | None = None
    received: int
    bytes: int
    part_bytes: int = LIMITS.part_bytes
    complete: bool


class Hashes(_Model):
    """Files by hash."""

    sha256: list[Hash] = Field(max_length=HASHES_PER_REQUEST)


class Missing(_Model):
    """Those that are not there."""

    missing: list[Hash]


class NewScene(_Model):
    """A scene: files that were uploaded before.

    Attributes:
        name: What its owner calls it.
        root: The file that is opened.
        files: Relative path -> sha256.
    """

    name: Title
    root: FilePath
    # Names are a pattern to JSON Schema, which lets in what does not match it unless told otherwise.
    files: dict[FilePath, Hash] = Field(min_length=1, json_schema_extra={"additionalProperties": False})


class Move(_Model):
    """Where an alias shall point, and why."""

    version: VersionOrAlias
    reason: Reason


class Reasoned(_Model):
    """Why."""

    reason: Reason


class NewKey(_Model):
    """A key to be made; `expires` is a time with a zone, `bounds` hold for its jobs."""

    name: Title
    scopes: list[Scope] = Field(min_length=1, max_length=4)
    expires: datetime | None = None
    bounds: JobBounds = JobBounds()


class CreatedKey(_Model):
    """A new key; the secret is shown this once."""

    key: KeyRecord
    secret: str


class NewWebhook(_Model):
    """A webhook to be made: where it is delivered, and what it hears of; by default everything."""

    url: Annotated[
        str, StringConstraints(min_length=1, max_length=LIMITS.webhook_url, pattern=r"^https?://[\x21-\x7e]+$")
    ]
    events: list[WebhookEvent] = Field(default=list(WEBHOOK_EVENTS), min_length=1, max_length=len(WEBHOOK_EVENTS))


class CreatedWebhook(_Model):
    """A new webhook; the secret is shown this once."""

    webhook: WebhookRecord
    secret: str


class AliasesRecord(_Model):
    """Where the aliases of a name point, and how they got there, latest move first."""

    aliases: dict[str, str]
    history: list[MoveRecord]


class Workers(_Model):
    """What waits, and who works."""

    queues: list[QueueRecord]
    executors: list[ExecutorRecord]


class SigningKeys(_Model):
    """Raw ed25519 public keys, base64: the one that versions and aliases are signed with, then those before it."""

    keys: list[str]


class Live(_Model):
    """The process answers."""

    status: str = "live"


class Ready(_Model):
    """Whether requests can be served.

    Attributes:
        status: `ready` or `unavailable`.
        database: Whether it answers.
        store: Whether it answers.
        missing_roles: Roles without a living worker: their tasks wait, everything else works.
    """

    status: str
    database: bool
    store: bool
    missing_roles: list[str]


class JobPage(_Model):
    """A page of jobs."""

    items: list[JobRecord]


class TaskPage(_Model):
    """A page of tasks."""

    items: list[TaskRecord]


class EventPage(_Model):
    """A page of events."""

    items: list[EventRecord]


class ScenePage(_Model):
    """A page of scenes."""

    items: list[SceneRecord]


class DatasetPage(_Model):
    """A page of data sets."""

    items: list[DatasetRecord]


class MeasurementPage(_Model):
    """A page of measurements."""

    items: list[MeasurementRecord]


class ModelPage(_Model):
    """A page of names in the registry."""

    items: list[ModelRecord]


class VersionPage(_Model):
    """A page of versions of a name."""

    items: list[VersionRecord]


class KeyPage(_Model):
    """A page of keys."""

    items: list[KeyRecord]


class WebhookPage(_Model):
    """A page of webhooks."""

    items: list[WebhookRecord]


class DeliveryPage(_Model):
    """A page of deliveries of a webhook."""

    items: list[DeliveryRecord]


class ProblemPage(_Model):
    """The catalogue of problems."""

    items: list[ProblemType]
