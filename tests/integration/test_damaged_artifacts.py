"""Artifacts of every kind, damaged so that their hashes hold: what is said of them names no folder of the service."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any
from urllib.parse import urlencode

import pytest
from support.api import Api
from support.bundles import make_bundle
from support.compare import FACTORS, Filled, fill
from support.dashboard import Visitor
from support.training import random_weights

from labeller.shards import read_shard
from renderer.dump import read_dump
from renderer.dump_pixels import DumpReader
from schemas.bundle import load_manifest
from schemas.problem import Problem
from schemas.service import ProblemDocument
from services.database import tables
from services.engine import problems
from services.problems import document_of, without_paths
from stages.allocations import pixel_allocations, read_allocation
from stages.desk import BUNDLE, SHARD, load_facts, save_facts
from stages.export import ExportFacts
from stages.inputs import TrainFacts
from stages.label import LabelFacts
from stages.store import Address, Store
from trainer.weights import load_weights, save_weights

SIZE = (6, 4)
F = int(FACTORS[0] * SIZE[0] * SIZE[1])


@pytest.fixture(scope="module")
def api(tmp_path_factory: pytest.TempPathFactory) -> Api:
    return Api(tmp_path_factory.mktemp("where nobody looks"), rate=1e6, burst=10**6)


@pytest.fixture(scope="module")
def filled(api: Api) -> Filled:
    return fill(api, SIZE)


READERS: dict[str, tuple[Callable[[Path], Any], ...]] = {
    "render": (read_dump, lambda folder: [DumpReader(folder).pixel(p) for p in range(SIZE[0] * SIZE[1])]),
    "label": (
        lambda folder: read_allocation(folder, "optimal", F),
        lambda folder: pixel_allocations(folder, F, 0),
        lambda folder: read_shard(folder / SHARD),
        lambda folder: load_facts(folder, LabelFacts),
    ),
    "train": (
        lambda folder: load_weights(folder / "weights.safetensors"),
        lambda folder: load_facts(folder, TrainFacts),
    ),
    "export": (lambda folder: load_manifest(folder / BUNDLE), lambda folder: load_facts(folder, ExportFacts)),
}
"""What the bodies of stages read of the artifacts that they need."""


def _made(api: Api, filled: Filled, stage: str) -> Address:
    view = filled.views["front"]
    if stage in ("render", "label"):
        return view.render if stage == "render" else view.label
    address = Address(stage, "v1")
    with api.service.storage.store.put(address) as folder:
        if stage == "train":
            save_facts(folder, TrainFacts(history=(), config={}))
            save_weights(folder / "weights.safetensors", random_weights(1))
        else:
            save_facts(folder, ExportFacts(digest="", files={}, parity=0.0))
            make_bundle(folder / BUNDLE)
    return address


def _damaged(store: Store, made: Address, number: int, name: Path, content: bytes | None) -> Path:
    """A copy of an artifact in which one file is another one, or missing, and whose list of files says the same."""
    source, address = (
        store.fetch(made.artifact),
        Address(made.stage, f"damaged {number} {name}", made.inputs, made.params),
    )
    with store.put(address) as folder:
        for file in (path for path in source.rglob("*") if path.is_file() and path.name != "meta.json"):
            target = folder / file.relative_to(source)
            target.parent.mkdir(parents=True, exist_ok=True)
            if file.relative_to(source) != name:
                target.write_bytes(file.read_bytes())
            elif content is not None:
                target.write_bytes(content)
    return store.fetch(address.artifact)


def _said(read: Callable[[Path], Any], folder: Path) -> ProblemDocument | None:
    """What the owner of a job is told if a body reads this and fails."""
    try:
        read(folder)
    except Problem as problem:
        return document_of(problem)
    except Exception as error:  # as `services.engine.child` says it
        summary = f"{type(error).__name__}: {without_paths((str(error).splitlines() or [''])[0])[:200]}"
        return document_of(problems.failed("the task", summary).problem)
    return None


@pytest.mark.parametrize("stage", READERS)
def test_a_damaged_artifact_is_named_without_its_folder(stage: str, api: Api, filled: Filled) -> None:
    store = api.service.storage.store
    made = _made(api, filled, stage)
    source = store.fetch(made.artifact)
    names = [path.relative_to(source) for path in source.rglob("*") if path.is_file() and path.name != "meta.json"]
    said: list[ProblemDocument] = []
    for number, content in enumerate((None, b"", b"{}", b"\xff" * 64)):
        for name in names:
            folder = _damaged(store, made, number, name, content)
            said += [found for read in READERS[stage] if (found := _said(read, folder)) is not None]
            store.remove(f"{stage}/{folder.name}")
    assert len(said) > len(names), "most of this damage is noticed"
    job_id = api.job()
    with api.service.database.write() as connection:
        for position, problem in enumerate(said):
            row = {"job_id": job_id, "stage": stage, "name": f"{stage} {position}", "position": position}
            row |= {"artifact": made.artifact, "task": {}, "state": "quarantined"}
            connection.execute(tables.tasks.insert().values(**row, problem=problem.model_dump(mode="json")))
        values = {"state": "failed", "problem": said[0].model_dump(mode="json")}
        connection.execute(tables.jobs.update().where(tables.jobs.c.id == job_id).values(**values))
    reader = Visitor(api, "read")
    for text in (
        "".join(problem.model_dump_json() for problem in said),
        api.get(f"/v1/jobs/{job_id}").text,
        api.get(f"/v1/jobs/{job_id}/tasks?limit=200").text,
        reader.get(f"/jobs/{job_id}").text,
    ):
        assert stage in text
        assert str(store.root.parent) not in text
        assert "nobody looks" not in text


@pytest.mark.parametrize("stage", ["render", "label", "evaluate"])
@pytest.mark.parametrize("keeps_hashes", [True, False])
def test_pages_of_damaged_artifacts_name_no_folder(stage: str, keeps_hashes: bool, tmp_path: Path) -> None:
    api = Api(tmp_path / "where nobody looks", rate=1e6, burst=10**6)
    filled, reader, store = fill(api, SIZE), Visitor(api, "read"), api.service.storage.store
    view = filled.views["front"]
    made = {"render": view.render, "label": view.label, "evaluate": view.evaluations[None]}[stage]
    folder = store.fetch(made.artifact)
    files = [path for path in folder.rglob("*") if path.is_file() and path.name != "meta.json"]
    if keeps_hashes:
        store.remove(made.artifact)
        with store.put(made) as again:
            for path in files:
                (again / path.relative_to(folder)).parent.mkdir(parents=True, exist_ok=True)
                (again / path.relative_to(folder)).write_bytes(b"{}")
    else:
        for path in files:
            path.write_bytes(b"{}")
    on = {"scene": filled.scene, "view": "front", "a": "kbuffer:1", "b": "exact"}
    for address in (
        f"/compare?{urlencode({**on, 'x': 1, 'y': 1})}",
        f"/compare/pixel?{urlencode({**on, 'x': 1, 'y': 1})}",
        *(f"/compare/picture.png?{urlencode({**on, 'show': show})}" for show in ("picture", "k", "difference", "flip")),
        f"/compare/picture.exr?{urlencode(on)}",
        f"/scenes/{filled.scene}",
        f"/scenes/{filled.scene}/pictures/{made.key}/k/kbuffer-1.k.png",
    ):
        answer = reader.get(address)
        assert b"nobody looks" not in answer.content, address
        if not (keeps_hashes and stage == "evaluate"):  # such pictures were written by a fault of the service
            assert answer.status_code < 500, (address, answer.text[:900])
