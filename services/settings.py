"""Configuration of the service: the only difference between a laptop and a cluster is these values."""

from __future__ import annotations

import ipaddress
from pathlib import Path
from typing import Any, Self

from pydantic import Field, ValidationError, field_validator, model_validator
from pydantic_settings import BaseSettings, SettingsConfigDict

from schemas.problem import Problem


class Settings(BaseSettings):
    """Read from the environment, `DIAPHANE_` and the name in capitals.

    Attributes:
        state: Folder of everything that is not in a shared database or store.
        database: SQLAlchemy-style URL, `sqlite:///PATH` or `postgresql://...`; empty: SQLite in `state`. A secret:
            whoever can write to the database can run code on the workers.
        store: Folder, or `s3://bucket/prefix` (credentials and endpoint as usual in `AWS_*`); empty: `state`/store.
        cache: Local copies of what lies in an object store; empty: `state`/cache.
        signing_key: ed25519 seed, base64, that versions and what aliases mean are signed with; empty: made once and
            kept in `state`.
        heartbeat: Seconds between two heartbeats of a process.
        ttl: Seconds of silence after which a process is taken for dead.
        poll: Seconds between two looks into a queue.
        slots_render: Child processes of a worker for the role `render`.
        slots_label: The same for `label`.
        slots_train: The same for `train`.
        slots_check: Uploads that a worker of the role `render` checks at once, beside its tasks.
        checks_per_key: Uploads of one key that all workers together check at once: less than their slots, so that one
            key cannot hold them all.
        check_seconds: Longest time of a check.
        check_turn: Seconds after which a check makes room for others that wait, and begins again beside them.
        check_bytes: Memory that a check's process may use.
        task_seconds: Longest time of a task other than a training.
        train_seconds: Longest time of a training.
        task_bytes: Memory that a task's process may use; 0: no bound.
        drain_seconds: How long a server that is told to stop waits for requests, and a worker for tasks, under way.
        keep_days: Artifacts, jobs and events unused for longer are removed; 0: kept.
        keep_bytes: Beyond this the least recently used artifacts are removed; 0: no bound.
        hosts: Names, separated by commas, that the API answers for beside those of the loopback interface; `*`: any.
        proxies: Addresses and networks, separated by commas, of the proxies in front whose `X-Forwarded-For` and
            `X-Forwarded-Proto` are believed; empty: nobody's.
        rate: Requests a second that a key may make, on average.
        burst: Requests that it may make at once.
        job_pixels: Pixels of all views of a job, where its key has no bound of its own; keys with `admin` have none.
        job_steps: Optimiser steps of a job; the same.
        jobs: Jobs of a key that have not ended; the same.
        webhook_networks: Addresses and networks, separated by commas, that webhooks may lead to beside public ones;
            empty: none.
    """

    model_config = SettingsConfigDict(env_prefix="DIAPHANE_", frozen=True, extra="ignore")

    state: Path = Path(".diaphane")
    database: str = Field(default="", repr=False)
    store: str = ""
    cache: str = ""
    signing_key: str = Field(default="", repr=False)
    heartbeat: float = Field(default=1.0, gt=0.0)
    ttl: float = Field(default=10.0, gt=0.0)
    poll: float = Field(default=0.2, gt=0.0)
    slots_render: int = Field(default=1, ge=1)
    slots_label: int = Field(default=1, ge=1)
    slots_train: int = Field(default=1, ge=1)
    slots_check: int = Field(default=2, ge=1)
    checks_per_key: int = Field(default=1, ge=1)
    check_seconds: float = Field(default=30.0, gt=0.0)
    check_turn: float = Field(default=4.0, gt=0.0)
    check_bytes: int = Field(default=2 << 30, ge=512 << 20)
    task_seconds: float = Field(default=1800.0, gt=0.0)
    train_seconds: float = Field(default=7 * 86400.0, gt=0.0)
    task_bytes: int = Field(default=0, ge=0)
    drain_seconds: float = Field(default=20.0, ge=0.0)
    keep_days: float = Field(default=30.0, ge=0.0)
    keep_bytes: int = Field(default=0, ge=0)
    hosts: str = ""
    rate: float = Field(default=50.0, gt=0.0)
    burst: int = Field(default=200, ge=1)
    proxies: str = ""
    job_pixels: int = Field(default=10**10, ge=1)
    job_steps: int = Field(default=100_000, ge=1)
    jobs: int = Field(default=100, ge=1)
    webhook_networks: str = ""

    def __init__(self, **values: Any) -> None:
        try:
            super().__init__(**values)
        except ValidationError as error:
            first = error.errors()[0]
            name = "_".join(str(part) for part in first["loc"]).upper()
            raise Problem(
                f"DIAPHANE_{name} cannot be used: {first['msg']}." if name else f"{first['msg']}.",
                "Correct that variable of the environment, or unset it.",
            ) from error

    @model_validator(mode="after")
    def _patient(self) -> Self:
        if self.ttl < 3.0 * self.heartbeat:
            raise ValueError("DIAPHANE_TTL must be at least three times DIAPHANE_HEARTBEAT")
        return self

    @field_validator("proxies", "webhook_networks")
    @classmethod
    def _are_addresses(cls, text: str) -> str:
        for part in _parts(text):
            ipaddress.ip_network(part)
        return text

    @property
    def trusted_proxies(self) -> tuple[str, ...]:
        """`proxies`, one by one."""
        return _parts(self.proxies)

    @property
    def database_url(self) -> str:
        """`database`, or SQLite in the state folder."""
        return self.database or f"sqlite:///{self.state.resolve() / 'diaphane.sqlite'}"

    @property
    def store_url(self) -> str:
        """`store`, or a folder in the state folder."""
        return self.store or str(self.state.resolve() / "store")

    @property
    def cache_folder(self) -> Path:
        """Where local copies of an object store's content lie."""
        return Path(self.cache) if self.cache else self.state.resolve() / "cache"


def _parts(text: str) -> tuple[str, ...]:
    return tuple(part.strip() for part in text.split(",") if part.strip())
