"""All tables. Times are seconds since 1970 UTC; JSON columns hold what the schemas of that name dump."""

from __future__ import annotations

from typing import Final

import sqlalchemy as sa

SCHEMA: Final = "2"
METADATA: Final = sa.MetaData()


def _table(name: str, *parts: sa.schema.SchemaItem) -> sa.Table:
    return sa.Table(name, METADATA, *parts)


meta = _table("meta", sa.Column("name", sa.Text, primary_key=True), sa.Column("value", sa.Text, nullable=False))
"""Facts about the database itself: `schema`, the version of the tables."""

executors = _table(
    "executors",
    sa.Column("id", sa.Text, primary_key=True),
    sa.Column("host", sa.Text, nullable=False),
    sa.Column("pid", sa.Integer, nullable=False),
    sa.Column("started", sa.Text, nullable=False),  # of the process, as the kernel counts: tells a reused pid apart
    sa.Column("roles", sa.Text, nullable=False),
    sa.Column("last_seen", sa.Double, nullable=False),
)
"""Processes that run work, one row for each process life; `last_seen` by the database's clock."""

keys = _table(
    "api_keys",
    sa.Column("id", sa.Text, primary_key=True),
    sa.Column("name", sa.Text, nullable=False),
    sa.Column("digest", sa.Text, nullable=False, unique=True),
    sa.Column("scopes", sa.JSON, nullable=False),
    sa.Column("created", sa.Double, nullable=False),
    sa.Column("expires", sa.Double),
    sa.Column("revoked", sa.Double),
    sa.Column("last_used", sa.Double),
    sa.Column("job_pixels", sa.BigInteger),
    sa.Column("job_steps", sa.BigInteger),
    sa.Column("jobs", sa.BigInteger),
)
"""API keys: a hash of the secret, never the secret; and what their jobs may ask for, where that was set."""

allowances = _table(
    "allowances",
    sa.Column("kind", sa.Text, primary_key=True),
    sa.Column("name", sa.Text, primary_key=True),
    sa.Column("level", sa.Double, nullable=False),
    sa.Column("at", sa.Double, nullable=False),
)
"""Token buckets of the API's processes: tokens at a time of the database's clock; one that is missing is full."""

sessions = _table(
    "sessions",
    sa.Column("digest", sa.Text, primary_key=True),
    sa.Column("key_id", sa.Text, nullable=False),
    sa.Column("created", sa.Double, nullable=False),
    sa.Column("expires", sa.Double, nullable=False, index=True),
)
"""Who is signed in to the dashboard: a hash of the browser's token, never the token, and the key that it stands for."""

uploads = _table(
    "uploads",
    sa.Column("id", sa.Text, primary_key=True),
    sa.Column("sha256", sa.Text, nullable=False),
    sa.Column("bytes", sa.BigInteger, nullable=False),
    sa.Column("received", sa.BigInteger, nullable=False),
    sa.Column("created", sa.Double, nullable=False),
    sa.Column("created_by", sa.Text, nullable=False),
    sa.Column("finished", sa.Double),
)
"""Uploads under way: parts lie in the store until all are there and the hash holds."""

scenes = _table(
    "scenes",
    sa.Column("id", sa.Text, primary_key=True),
    sa.Column("digest", sa.Text, nullable=False, unique=True),
    sa.Column("name", sa.Text, nullable=False),
    sa.Column("root", sa.Text, nullable=False),
    sa.Column("files", sa.JSON, nullable=False),  # relative path -> {"sha256", "bytes"}
    sa.Column("bytes", sa.BigInteger, nullable=False),
    sa.Column("state", sa.Text, nullable=False),  # checking, accepted, rejected
    sa.Column("problem", sa.JSON),
    sa.Column("facts", sa.JSON),
    sa.Column("created", sa.Double, nullable=False, index=True),
    sa.Column("created_by", sa.Text, nullable=False),
)
"""Scenes: files by hash. The digest is over names and hashes, so the same scene is one row however often it comes."""

jobs = _table(
    "jobs",
    sa.Column("id", sa.Text, primary_key=True),
    sa.Column("kind", sa.Text, nullable=False),
    sa.Column("name", sa.Text),
    sa.Column("spec", sa.JSON, nullable=False),
    sa.Column("state", sa.Text, nullable=False, index=True),
    sa.Column("attempt", sa.Integer, nullable=False),
    sa.Column("stage", sa.Text),
    sa.Column("priority", sa.Text, nullable=False),
    sa.Column("created", sa.Double, nullable=False, index=True),
    sa.Column("started", sa.Double),
    sa.Column("finished", sa.Double),
    sa.Column("submitted_by", sa.Text, nullable=False),
    sa.Column("request_id", sa.Text),
    sa.Column("idempotency_key", sa.Text),
    sa.Column("idempotency_digest", sa.Text),
    sa.Column("last_event", sa.Integer, nullable=False),
    sa.Column("problem", sa.JSON),
    sa.Column("result", sa.JSON),
    sa.Column("skipped", sa.JSON, nullable=False),
    sa.UniqueConstraint("submitted_by", "idempotency_key"),
)
"""Jobs. `attempt` counts the retries; `last_event` is the number of the last event, given under this row's lock."""

tasks = _table(
    "tasks",
    sa.Column("job_id", sa.Text, sa.ForeignKey("jobs.id", ondelete="CASCADE"), primary_key=True),
    sa.Column("stage", sa.Text, primary_key=True),
    sa.Column("name", sa.Text, primary_key=True),
    sa.Column("position", sa.Integer, nullable=False),
    sa.Column("artifact", sa.Text, nullable=False, index=True),  # stage/key
    sa.Column("task", sa.JSON, nullable=False),
    sa.Column("state", sa.Text, nullable=False),
    sa.Column("executor", sa.Text),
    sa.Column("progress", sa.Double),
    sa.Column("note", sa.Text),
    sa.Column("started", sa.Double),
    sa.Column("finished", sa.Double),
    sa.Column("seconds", sa.Double),
    sa.Column("problem", sa.JSON),
)
"""Tasks of a job, one for each artifact that it needs made or found there."""

events = _table(
    "events",
    sa.Column("job_id", sa.Text, sa.ForeignKey("jobs.id", ondelete="CASCADE"), primary_key=True),
    sa.Column("number", sa.Integer, primary_key=True),
    sa.Column("at", sa.Double, nullable=False),
    sa.Column("kind", sa.Text, nullable=False),  # state, stage, task, log
    sa.Column("data", sa.JSON, nullable=False),
)
"""What happened in a job, numbered without gaps from 1, so that a listener can go on where it stopped."""

datasets = _table(
    "datasets",
    sa.Column("id", sa.Text, primary_key=True),
    sa.Column("job_id", sa.Text),
    sa.Column("created", sa.Double, nullable=False, index=True),
    sa.Column("settings", sa.JSON, nullable=False),
    sa.Column("shards", sa.JSON, nullable=False),  # [{"scene","digest","view","artifact","sha256","bytes"}]
)
"""Data sets: label shards, and what they were made with."""

versions = _table(
    "versions",
    sa.Column("name", sa.Text, primary_key=True),
    sa.Column("version", sa.Text, primary_key=True),
    sa.Column("ordinal", sa.Integer, nullable=False),
    sa.Column("digest", sa.Text, nullable=False),
    sa.Column("score", sa.Double),
    sa.Column("evaluation", sa.JSON, nullable=False),
    sa.Column("files", sa.JSON, nullable=False),  # name -> {"sha256", "bytes"}
    sa.Column("artifacts", sa.JSON, nullable=False),  # stage/key of what it was made from: never removed
    sa.Column("statement", sa.Text, nullable=False),
    sa.Column("signature", sa.Text, nullable=False),
    sa.Column("public_key", sa.Text, nullable=False),
    sa.Column("created", sa.Double, nullable=False, index=True),
    sa.Column("job_id", sa.Text),
    sa.UniqueConstraint("name", "digest"),
    sa.UniqueConstraint("name", "ordinal"),
)
"""Published versions; a row never changes, but for its signature when the signing key does."""

aliases = _table(
    "aliases",
    sa.Column("name", sa.Text, primary_key=True),
    sa.Column("alias", sa.Text, primary_key=True),
    sa.Column("version", sa.Text, nullable=False),
)
"""What an alias means now."""

moves = _table(
    "moves",
    sa.Column("id", sa.Integer, primary_key=True, autoincrement=True),
    sa.Column("name", sa.Text, nullable=False, index=True),
    sa.Column("alias", sa.Text, nullable=False),
    sa.Column("before", sa.Text),
    sa.Column("after", sa.Text, nullable=False),
    sa.Column("at", sa.Double, nullable=False),
    sa.Column("who", sa.Text, nullable=False),
    sa.Column("why", sa.Text, nullable=False),
)
"""Every move of every alias."""

handovers = _table(
    "handovers",
    sa.Column("id", sa.Integer, primary_key=True, autoincrement=True),
    sa.Column("old_key", sa.Text, nullable=False),
    sa.Column("new_key", sa.Text, nullable=False),
    sa.Column("statement", sa.Text),
    sa.Column("signature", sa.Text),
    sa.Column("at", sa.Double, nullable=False),
)
"""Every change of the signing key; without a statement where the old key was lost."""

webhooks = _table(
    "webhooks",
    sa.Column("id", sa.Text, primary_key=True),
    sa.Column("url", sa.Text, nullable=False),
    sa.Column("events", sa.JSON, nullable=False),
    sa.Column("secret", sa.Text, nullable=False),
    sa.Column("created", sa.Double, nullable=False),
    sa.Column("created_by", sa.Text, nullable=False),
)
"""Who is told of what. The secret itself, for it signs what is sent: a hash of it could not."""

deliveries = _table(
    "deliveries",
    sa.Column("id", sa.Text, primary_key=True),
    sa.Column("webhook_id", sa.Text, sa.ForeignKey("webhooks.id", ondelete="CASCADE"), nullable=False, index=True),
    sa.Column("event", sa.Text, nullable=False),
    sa.Column("body", sa.Text, nullable=False),
    sa.Column("state", sa.Text, nullable=False),  # waiting, delivered, failed
    sa.Column("attempts", sa.Integer, nullable=False),
    sa.Column("created", sa.Double, nullable=False),
    sa.Column("due", sa.Double, nullable=False),
    sa.Column("claim", sa.Text),
    sa.Column("finished", sa.Double),
    sa.Column("status", sa.Integer),
    sa.Column("problem", sa.Text),
    sa.Index("deliveries_due", "state", "due"),
)
"""What is told to whom, and what became of it. `due` is by the database's clock; while `claim` is set, it is the end of
the lease."""

measurements = _table(
    "measurements",
    sa.Column("id", sa.Integer, primary_key=True, autoincrement=True),
    sa.Column("artifact", sa.Text, nullable=False),
    sa.Column("position", sa.Integer, nullable=False),
    sa.Column("job_id", sa.Text),
    sa.Column("model", sa.Text, index=True),  # name@version of the bundle, for its own pictures
    sa.Column("scene", sa.Text, nullable=False, index=True),
    sa.Column("scene_digest", sa.Text, nullable=False, index=True),
    sa.Column("view", sa.Text, nullable=False),
    sa.Column("technique", sa.Text, nullable=False, index=True),
    sa.Column("budget_factor", sa.Double, nullable=False),
    sa.Column("created", sa.Double, nullable=False, index=True),
    sa.Column("data", sa.JSON, nullable=False),
    sa.UniqueConstraint("artifact", "position"),
)
"""Measurements of pictures (`schemas.measurement.Measurement`), one row for each."""
