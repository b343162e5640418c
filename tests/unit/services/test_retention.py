"""Retention: whatever is used stays, and what is not used goes by age and by size."""

from __future__ import annotations

import hashlib
import os
import time
import uuid
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, cast

import pytest
import sqlalchemy as sa
from hypothesis import given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st
from support.bundles import make_bundle

from schemas.job import FINAL_STATES, JobState
from services.database import Database, open_database, tables
from services.registry import open_registry
from services.retention import (
    ARTIFACT_GRACE,
    BLOB_GRACE,
    CACHE_GRACE,
    DAY,
    UPLOAD_GRACE,
    SweepResult,
    sweep,
    sweep_cache,
)
from services.settings import Settings
from services.storage import Blobs, Storage
from stages.store import Address, Store, StoredArtifact

NOW = 2_000_000_000.0
ARTIFACTS = [f"{stage}/{n:064x}" for n, stage in enumerate(("render", "render", "label", "label", "train", "export"))]
BLOBS = [f"{n:064x}" for n in range(6)]
STATES: tuple[JobState, ...] = ("queued", "running", "cancelling", *FINAL_STATES)
Machine = Callable[[str], Storage]


class MemoryStore:
    """What retention sees of a store, in memory."""

    checkpoints = Path("no such folder")

    def __init__(self, found: list[StoredArtifact]) -> None:
        self.found = {artifact.artifact: artifact for artifact in found}

    def artifacts(self) -> Iterator[StoredArtifact]:
        yield from list(self.found.values())

    def remove(self, artifact: str) -> None:
        del self.found[artifact]

    def clean(self, now: float) -> None:
        pass

    def cached(self) -> Iterator[StoredArtifact]:
        return iter(())


class MemoryBlobs:
    """What retention sees of blobs, in memory."""

    def __init__(self, found: dict[str, tuple[int, float]]) -> None:
        self.found = found

    def all(self) -> Iterator[tuple[str, int, float]]:
        yield from [(sha256, *rest) for sha256, rest in self.found.items()]

    def remove(self, sha256: str) -> None:
        del self.found[sha256]

    def uploads(self) -> Iterator[tuple[str, float]]:
        return iter(())

    def cached(self) -> Iterator[tuple[str, int, float]]:
        return iter(())


def add_job(
    connection: sa.Connection, job_id: str, state: str, spec: dict[str, Any] | None = None, ended: float = NOW
) -> None:
    connection.execute(
        tables.jobs.insert().values(
            id=job_id,
            kind="build",
            spec=spec or {},
            state=state,
            attempt=1,
            priority="normal",
            created=ended - 60.0,
            finished=ended if state in FINAL_STATES else None,
            submitted_by="key_1",
            last_event=1,
            skipped={},
        )
    )
    connection.execute(tables.events.insert().values(job_id=job_id, number=1, at=ended, kind="state", data={}))


def add_task(
    connection: sa.Connection, job_id: str, artifact: str, needs: tuple[str, ...] = (), blob: str | None = None
) -> None:
    source = {"digest": "d", "files": {"a.usda": blob}} if blob else None
    connection.execute(
        tables.tasks.insert().values(
            job_id=job_id,
            stage=artifact.partition("/")[0],
            name=uuid.uuid4().hex,
            position=0,
            artifact=artifact,
            task={"needs": list(needs), "scene": source},
            state="queued",
        )
    )


def add_scene(connection: sa.Connection, scene_id: str, blobs: list[str], created: float) -> None:
    connection.execute(
        tables.scenes.insert().values(
            id=scene_id,
            digest=scene_id,
            name=scene_id,
            root="a.usda",
            files={f"{i}.usda": {"sha256": blob, "bytes": 1} for i, blob in enumerate(blobs)},
            bytes=1,
            state="accepted",
            created=created,
            created_by="key_1",
        )
    )


def add_version(
    connection: sa.Connection, number: int, artifacts: list[str], blobs: list[str], job_id: str | None = None
) -> None:
    connection.execute(
        tables.versions.insert().values(
            name="glass",
            version=f"1.{number}.0",
            ordinal=number,
            digest=str(number),
            evaluation={},
            files={f"{i}": {"sha256": blob, "bytes": 1} for i, blob in enumerate(blobs)},
            artifacts=artifacts,
            statement="",
            signature="",
            public_key="",
            created=0.0,
            job_id=job_id,
        )
    )


def add_dataset(connection: sa.Connection, dataset_id: str, artifacts: list[str], created: float) -> None:
    shards = [{"artifact": artifact} for artifact in artifacts]
    connection.execute(tables.datasets.insert().values(id=dataset_id, created=created, settings={}, shards=shards))


def ids(database: Database, table: sa.Table) -> set[str]:
    with database.read() as connection:
        return set(connection.scalars(sa.select(table.c.id)))


@pytest.fixture(scope="module")
def reused_database(tmp_path_factory: pytest.TempPathFactory) -> Database:
    return open_database("sqlite:///" + str(tmp_path_factory.mktemp("retention") / "test.sqlite"))


_AGES = st.sampled_from([0.0, 0.5 * ARTIFACT_GRACE, 2 * ARTIFACT_GRACE, 0.5 * DAY, 2 * DAY, 40 * DAY, 400 * DAY])
_SOME_ARTIFACTS = st.lists(st.sampled_from(ARTIFACTS), max_size=3, unique=True)
_SOME_BLOBS = st.lists(st.sampled_from(BLOBS), max_size=3, unique=True)
_JOBS = st.lists(
    st.fixed_dictionaries(
        {
            "state": st.sampled_from(STATES),
            "age": _AGES,
            "tasks": _SOME_ARTIFACTS,
            "needs": _SOME_ARTIFACTS,
            "blob": st.none() | st.sampled_from(BLOBS),
            "scene": st.none() | st.sampled_from(["scn_0", "scn_1"]),
            "dataset": st.none() | st.just("dst_0"),
        }
    ),
    max_size=3,
)
_VERSIONS = st.lists(st.tuples(_SOME_ARTIFACTS, _SOME_BLOBS, st.none() | st.integers(0, 2)), max_size=2)


@given(
    jobs=_JOBS,
    versions=_VERSIONS,
    scenes=st.lists(st.tuples(_SOME_BLOBS, _AGES), max_size=2),
    dataset=st.none() | st.tuples(_SOME_ARTIFACTS, _AGES),
    uses=st.lists(_AGES, min_size=12, max_size=12),
    keep_days=st.sampled_from([0.0, 0.01, 1.0, 30.0]),
    keep_bytes=st.sampled_from([0, 1, 50, 500]),
)
@hypothesis_settings(max_examples=100)
def test_nothing_that_a_version_or_an_unfinished_job_refers_to_is_ever_removed(
    reused_database: Database,
    jobs: list[dict[str, Any]],
    versions: list[tuple[list[str], list[str], int | None]],
    scenes: list[tuple[list[str], float]],
    dataset: tuple[list[str], float] | None,
    uses: list[float],
    keep_days: float,
    keep_bytes: int,
) -> None:
    database = reused_database
    artifacts_in_use, blobs_in_use, scenes_in_use = set[str](), set[str](), set[str]()
    publishers = {f"job_{job}" for _, _, job in versions if job is not None and job < len(jobs)}
    with database.write() as connection:
        for table in (tables.jobs, tables.scenes, tables.datasets, tables.versions):
            connection.execute(table.delete())
        for i, (files, age) in enumerate(scenes):
            add_scene(connection, f"scn_{i}", files, NOW - age)
        if dataset is not None:
            add_dataset(connection, "dst_0", dataset[0], NOW - dataset[1])
        for i, job in enumerate(jobs):
            spec = {"scenes": [{"scene": job["scene"]}] if job["scene"] else [], "dataset": job["dataset"]}
            add_job(connection, f"job_{i}", job["state"], spec, NOW - job["age"])
            for artifact in job["tasks"]:
                add_task(connection, f"job_{i}", artifact, tuple(job["needs"]), job["blob"])
            unfinished = job["state"] not in FINAL_STATES
            if unfinished and job["tasks"]:
                artifacts_in_use |= {*job["tasks"], *job["needs"]}
                blobs_in_use |= {job["blob"]} - {None}
            if unfinished and job["dataset"] and dataset:
                artifacts_in_use |= set(dataset[0])
            if (unfinished or f"job_{i}" in publishers) and job["scene"] and int(job["scene"][-1]) < len(scenes):
                scenes_in_use.add(job["scene"])
                blobs_in_use |= set(scenes[int(job["scene"][-1])][0])
        for number, (artifacts, files, publisher) in enumerate(versions):
            add_version(connection, number, artifacts, files, None if publisher is None else f"job_{publisher}")
            artifacts_in_use |= set(artifacts)
            blobs_in_use |= set(files)
    store = MemoryStore([StoredArtifact(name, 40, NOW - uses[i]) for i, name in enumerate(ARTIFACTS)])
    blobs = MemoryBlobs({name: (40, NOW - uses[6 + i]) for i, name in enumerate(BLOBS)})
    unfinished_jobs = {f"job_{i}" for i, job in enumerate(jobs) if job["state"] not in FINAL_STATES}
    settings = Settings(keep_days=keep_days, keep_bytes=keep_bytes)
    result = sweep(database, Storage(cast(Store, store), cast(Blobs, blobs)), settings, NOW)
    assert artifacts_in_use <= set(store.found)
    assert blobs_in_use <= set(blobs.found)
    assert unfinished_jobs | publishers <= ids(database, tables.jobs)
    assert scenes_in_use <= ids(database, tables.scenes)
    young = {name for i, name in enumerate(ARTIFACTS) if uses[i] < ARTIFACT_GRACE}
    assert young <= set(store.found)
    assert {name for i, name in enumerate(BLOBS) if uses[6 + i] < BLOB_GRACE} <= set(blobs.found)
    assert result.artifacts == len(ARTIFACTS) - len(store.found)
    assert result.blobs == len(BLOBS) - len(blobs.found)
    assert result.bytes == 40 * (result.artifacts + result.blobs)
    if keep_days == 0.0 and keep_bytes == 0:
        assert result == SweepResult()
    if keep_days > 0.0:
        loose = {name for i, name in enumerate(ARTIFACTS) if uses[i] > max(keep_days * DAY, ARTIFACT_GRACE)}
        assert not (loose - artifacts_in_use) & set(store.found)
    for scene in ids(database, tables.scenes):  # a scene that is listed is whole
        assert set(scenes[int(scene[-1])][0]) <= set(blobs.found)


@pytest.fixture
def database(database_url: str) -> Database:
    return open_database(database_url)


def make(storage: Storage, name: str, size: int, age: float) -> str:
    address = Address("render", "v1", (name,))
    with storage.store.put(address) as folder:
        (folder / "data").write_bytes(bytes(size))
    os.utime(storage.store.path(address), (time.time() - age, time.time() - age))
    return address.artifact


def folder_storage(tmp_path: Path) -> Storage:
    return Storage(Store(tmp_path / "store"), Blobs(tmp_path / "store"))


def test_what_was_not_used_for_long_goes_and_what_was_used_stays(database: Database, tmp_path: Path) -> None:
    storage = folder_storage(tmp_path)
    old, used, published = (make(storage, name, 10, 40 * DAY) for name in ("old", "used", "published"))
    storage.store.fetch(used)
    with database.write() as connection:
        add_version(connection, 0, [published], [])
    result = sweep(database, storage, Settings(state=tmp_path, keep_days=30.0), time.time())
    assert {found.artifact for found in storage.store.artifacts()} == {used, published}
    assert (result.artifacts, result.blobs) == (1, 0)
    assert not storage.store.holds(old)


def test_the_least_recently_used_go_first_when_there_is_too_much(database: Database, tmp_path: Path) -> None:
    storage = folder_storage(tmp_path)
    names = [make(storage, str(hours), 10_000, hours * 3600.0) for hours in range(2, 7)]
    sizes = sum(found.bytes for found in storage.store.artifacts())
    settings = Settings(state=tmp_path, keep_days=0.0, keep_bytes=sizes - 15_000)
    assert sweep(database, storage, settings, time.time()).artifacts == 2
    assert {found.artifact for found in storage.store.artifacts()} == set(names[:3])


def test_a_blob_that_no_scene_and_no_version_has_goes_by_age(machine: Machine, tmp_path: Path) -> None:
    storage = machine("one")
    settings = Settings(state=tmp_path / "state", keep_days=30.0)
    database = open_database(f"sqlite:///{tmp_path / 'test.sqlite'}")
    registry = open_registry(database, storage.blobs, settings)
    publication = registry.publish("glass", make_bundle(tmp_path / "bundle"), 0.5, {})
    scene, loose = storage.blobs.put_bytes(b"scene").sha256, storage.blobs.put_bytes(b"loose").sha256
    with database.write() as connection:
        add_scene(connection, "scn_0", [scene], time.time() + 15 * DAY)
    later = time.time() + 31 * DAY
    assert sweep(database, storage, settings, later).blobs == 1
    assert not storage.blobs.has(loose)
    assert storage.blobs.has(scene)
    assert {name for name, _, _ in storage.blobs.all()} == {
        scene,
        *(file.sha256 for file in registry.record(publication).files.values()),
    }


def test_jobs_go_with_their_events_but_publishers_keep_their_row(database: Database, tmp_path: Path) -> None:
    old, young = NOW - 31 * DAY, NOW - 29 * DAY
    with database.write() as connection:
        for job_id, state, ended in (
            ("job_old", "succeeded", old),
            ("job_failed", "failed", old),
            ("job_young", "succeeded", young),
            ("job_running", "running", old),
            ("job_publisher", "succeeded", old),
        ):
            add_job(connection, job_id, state, None, ended)
            add_task(connection, job_id, ARTIFACTS[0])
        add_version(connection, 0, [], [], "job_publisher")
    assert sweep(database, folder_storage(tmp_path), Settings(keep_days=30.0), NOW).jobs == 2
    assert ids(database, tables.jobs) == {"job_young", "job_running", "job_publisher"}
    with database.read() as connection:
        for table in (tables.events, tables.tasks):
            assert set(connection.scalars(sa.select(table.c.job_id))) == {"job_young", "job_running"}


def test_scenes_and_data_sets_stay_while_a_job_names_them(database: Database, tmp_path: Path) -> None:
    with database.write() as connection:
        for name in ("scn_used", "scn_old"):
            add_scene(connection, name, [], NOW - 40 * DAY)
        add_scene(connection, "scn_young", [], NOW)
        for name in ("dst_used", "dst_old"):
            add_dataset(connection, name, [], NOW - 40 * DAY)
        add_job(connection, "job_1", "succeeded", {"scenes": [{"scene": "scn_used"}]}, NOW)
        add_job(connection, "job_2", "failed", {"dataset": "dst_used"}, NOW)
    result = sweep(database, folder_storage(tmp_path), Settings(keep_days=30.0), NOW)
    assert (result.scenes, result.datasets) == (1, 1)
    assert ids(database, tables.scenes) == {"scn_used", "scn_young"}
    assert ids(database, tables.datasets) == {"dst_used"}


def test_a_scene_whose_files_were_just_asked_for_stays(database: Database, tmp_path: Path) -> None:
    storage = folder_storage(tmp_path)
    blob = storage.blobs.put_bytes(b"data").sha256
    with database.write() as connection:
        add_scene(connection, "scn_0", [blob], time.time() - 40 * DAY)
    settings = Settings(keep_days=30.0)
    assert sweep(database, storage, settings, time.time()).scenes == 0
    assert sweep(database, storage, settings, time.time() + 31 * DAY).scenes == 1
    assert not storage.blobs.has(blob)


def test_a_data_set_goes_when_one_of_its_shards_does(database: Database, tmp_path: Path) -> None:
    storage = folder_storage(tmp_path)
    old, young = make(storage, "old", 10, 40 * DAY), make(storage, "young", 10, 0.0)
    with database.write() as connection:
        add_dataset(connection, "dst_broken", [old, young], time.time())
        add_dataset(connection, "dst_whole", [young], time.time())
    assert sweep(database, storage, Settings(keep_days=30.0), time.time()).datasets == 1
    assert ids(database, tables.datasets) == {"dst_whole"}


def test_uploads_that_nobody_goes_on_with_are_given_up(machine: Machine, tmp_path: Path) -> None:
    storage, now = machine("one"), time.time()
    database = open_database(f"sqlite:///{tmp_path / 'test.sqlite'}")
    slow, stale, unknown = (f"upl_{digit * 24}" for digit in "abc")
    with database.write() as connection:
        for upload_id, age in ((slow, 3 * DAY), (stale, 2 * DAY)):
            connection.execute(
                tables.uploads.insert().values(
                    id=upload_id, sha256="0" * 64, bytes=10, received=2, created=now - age, created_by="key_1"
                )
            )
    for upload_id in (slow, unknown):
        storage.blobs.append_part(upload_id, 0, b"ab")
    assert sweep(database, storage, Settings(keep_days=0.0), now).uploads == 1
    assert ids(database, tables.uploads) == {slow}
    assert sweep(database, storage, Settings(keep_days=0.0), now + UPLOAD_GRACE + 60).uploads == 2
    assert ids(database, tables.uploads) == set()
    assert list(storage.blobs.uploads()) == []


def test_local_copies_of_an_object_store_go_and_can_be_fetched_again(tmp_path: Path, s3_url: str) -> None:
    from services.storage import open_storage

    storage = open_storage(Settings(state=tmp_path / "one", store=s3_url))
    database = open_database(f"sqlite:///{tmp_path / 'test.sqlite'}")
    artifact = make(storage, "a", 1000, 0.0)
    storage.store.push(Address("render", "v1", ("a",)))
    blob = storage.blobs.put_bytes(b"data").sha256
    with database.write() as connection:
        add_version(connection, 0, [artifact], [blob])
    settings = Settings(keep_days=0.0, keep_bytes=1)
    sweep(database, storage, settings, time.time() + CACHE_GRACE - 60)
    assert len(list(storage.store.cached())) == len(list(storage.blobs.cached())) == 1
    sweep(database, storage, settings, time.time() + CACHE_GRACE + 60)
    assert list(storage.store.cached()) == list(storage.blobs.cached()) == []
    assert (storage.store.fetch(artifact) / "data").stat().st_size == 1000
    assert hashlib.sha256(storage.blobs.path(blob).read_bytes()).hexdigest() == blob


def test_checkpoints_of_a_training_that_another_worker_finished_go(machine: Machine, tmp_path: Path) -> None:
    storage = machine("one")
    done, open_one = (Address("train", "v1", (name,)) for name in ("a", "b"))
    with storage.store.put(done) as folder:
        (folder / "data").write_bytes(b"weights")
    for address in (done, open_one):
        (storage.store.checkpoints / address.key).mkdir(parents=True)
        (storage.store.checkpoints / f"{address.key}.safetensors").touch()  # of a local build
    sweep_cache(storage, Settings(state=tmp_path), time.time())
    left = {path.name for path in storage.store.checkpoints.iterdir()}
    assert left == {open_one.key, f"{open_one.key}.safetensors", f"{done.key}.safetensors"}
