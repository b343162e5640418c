"""Jobs that begin with a version: through the API, the real pipeline and workers in processes of their own.

The bodies of the stages are stand-ins (`support.chaos.bodies`), which fetch and verify whatever a task needs.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from support.chaos.arena import Arena
from support.cluster import API
from support.postgres import Postgres
from support.s3 import S3Server

from stages.inputs import TrainedOn, trained_on


@pytest.fixture(scope="module")
def arena(postgres: Postgres, s3: S3Server, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Arena]:
    """A service on PostgreSQL and S3, which check more than SQLite and folders do; `base@1.0.0` saw one scene."""
    folder = tmp_path_factory.mktemp("postgresql")
    store = f"s3://{s3.new_bucket()}/some/prefix"
    with Arena(folder, postgres.new_database(), store, sleep=0.02) as found:
        found.start(API, "jobs,render,label", "train")
        (job,) = found.wait(found.submit("base", seed=0))
        assert job.state == "succeeded", job.problem
        yield found


def scene(arena: Arena, name: str) -> str:
    """Id of another scene, checked."""
    reference = arena.service.storage.blobs.put_bytes(f"#usda 1.0\n# {name}\n".encode())
    record, _ = arena.service.scenes.create(name, f"{name}.usda", {f"{name}.usda": reference.sha256}, "key_test")
    arena.service.scenes.resolve_check(record.id, {"triangles": 12})
    return record.id


def wanted(arena: Arena, name: str, **more: Any) -> dict[str, Any]:
    """A build of a new scene, with the same one held out, that begins with `base`."""
    spec = arena.spec(name, seed=0)
    uses = [{"scene": scene(arena, f"scene of {name}")}, spec["scenes"][1]]
    return {**spec, "scenes": uses, "start_from": "base@champion", **more}


def training(arena: Arena, job_id: str) -> tuple[str, list[TrainedOn], dict[str, Any]]:
    """The training of a job: its artifact, the shards that it read, and its parameters."""
    (task,) = arena.service.jobs.tasks(job_id, stage="train")
    address = arena.service.storage.store.made_from(task.artifact)
    return task.artifact, trained_on(address.inputs), dict(address.params)


def test_a_job_replays_what_its_beginning_was_trained_on_and_the_next_one_both(arena: Arena) -> None:
    base = arena.service.registry.resolve("base@1.0.0")
    answer = arena.post(wanted(arena, "tuned", patience=2))
    assert (answer.status_code, answer.json()["spec"]["start_from"]) == (202, "base@1.0.0")
    (job,) = arena.wait(answer.json()["id"])
    assert job.state == "succeeded", job.problem
    _, shards, params = training(arena, job.id)
    learned = [made for made in arena.service.registry.made_from(base) if made.startswith("label/")]
    assert [shard.artifact for shard in shards if shard.replayed] == learned
    assert [shard.replayed for shard in shards] == [False, True]
    assert (params["start"], params["patience"]) == (base.digest, 2)
    version = arena.service.registry.record(arena.service.registry.resolve("tuned"))
    assert set(version.provenance["scenes"]) == {"glass", "scene of tuned"}
    texts = [event.data["text"] for event in arena.service.jobs.events(job.id) if event.kind == "log"]
    assert any("starts from base@1.0.0" in text for text in texts)

    answer = arena.post(wanted(arena, "further", start_from="tuned"))
    (job,) = arena.wait(answer.json()["id"])
    assert job.state == "succeeded", job.problem
    assert sum(shard.replayed for shard in training(arena, job.id)[1]) == 2


def test_a_retry_is_the_same_training_wherever_the_alias_points_by_then(arena: Arena) -> None:
    with arena.gates("train:begin"):
        job_id = arena.post(wanted(arena, "again"), key="once").json()["id"]
        arena.reached("train:begin")
        (task,) = arena.service.jobs.tasks(job_id, stage="train")
        arena.service.jobs.cancel(job_id)
    assert arena.wait(job_id)[0].state == "cancelled"
    (other,) = arena.wait(arena.submit("base", seed=0, steps=7))
    assert other.state == "succeeded", other.problem
    newest = arena.service.registry.versions("base")[-1].version
    arena.service.registry.promote("base", newest, "the newest")
    try:
        spec = wanted(arena, "again")
        repeated = arena.post(spec, key="once")
        assert (repeated.status_code, repeated.json()["id"]) == (200, job_id), "the same request is the same job"
        arena.service.jobs.retry(job_id)
        (job,) = arena.wait(job_id)
        assert (job.state, job.attempt) == ("succeeded", 2), job.problem
        assert training(arena, job_id)[0] == task.artifact
        assert arena.post(spec).json()["spec"]["start_from"] == f"base@{newest}"
    finally:
        arena.service.registry.promote("base", "1.0.0", "as before")


def test_what_cannot_be_begun_with_is_refused_before_anything_is_queued(arena: Arena) -> None:
    before = len(arena.service.jobs.list())
    assert arena.post(wanted(arena, "x", start_from="nobody")).status_code == 404
    assert arena.post(wanted(arena, "x", start_from="base@9.0.0")).status_code == 404
    mixed = arena.post(wanted(arena, "x", seed=5))
    assert (mixed.status_code, "labelled otherwise: seed 0 instead of 5" in mixed.json()["detail"]) == (422, True)
    spec = wanted(arena, "x")
    trained = arena.spec("x", seed=0)["scenes"][0]
    known = arena.post({**spec, "scenes": [spec["scenes"][0], {**trained, "holdout": True}]})
    assert (known.status_code, "glass is held out" in known.json()["detail"]) == (422, True)
    assert arena.post({**spec, "kind": "render"}).status_code == 422
    assert arena.post({**spec, "patience": -1}).status_code == 422
    assert len(arena.service.jobs.list()) == before
