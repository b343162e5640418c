from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

import pytest
from support.api import HASH, Api, build_spec, measurement, shard
from support.postgres import Postgres

from services.database import tables
from services.registry.signing import verify
from stages.store import Address


def test_a_job_is_submitted_once_for_a_key(api: Api) -> None:
    spec = build_spec(api.scene())
    headers = {"Idempotency-Key": "build-1"}
    first = api.post("/v1/jobs", json=spec, headers=headers)
    again = api.post("/v1/jobs", json=spec, headers=headers)
    assert (first.status_code, again.status_code) == (202, 200)
    assert first.json()["id"] == again.json()["id"]
    assert first.headers["location"] == f"/v1/jobs/{first.json()['id']}"
    assert first.json()["request_id"] == first.headers["x-request-id"]
    other = api.post("/v1/jobs", json=spec | {"seed": 1}, headers=headers)
    assert (other.status_code, other.json()["type"]) == (409, "/v1/problems/conflict")
    assert api.post("/v1/jobs", "admin", json=spec, headers=headers).status_code == 202  # of another caller
    assert len(api.get("/v1/jobs").json()["items"]) == 2


def test_nothing_is_queued_for_what_does_not_exist_or_is_not_accepted(api: Api) -> None:
    sha256 = api.service.storage.blobs.put_bytes(b"#usda 1.0\n\n").sha256
    scene = api.post("/v1/scenes", json={"name": "s", "root": "a.usda", "files": {"a.usda": sha256}})
    assert (scene.status_code, scene.json()["state"]) == (202, "checking")
    answer = api.post("/v1/jobs", json=build_spec(scene.json()["id"]))
    assert (answer.status_code, answer.json()["type"]) == (409, "/v1/problems/scene-not-accepted")
    assert api.post("/v1/jobs", json=build_spec("scn_" + "0" * 32)).status_code == 404
    train = {"kind": "train", "name": "glass", "dataset": "dst_" + "0" * 32}
    assert api.post("/v1/jobs", json=train).status_code == 404
    evaluate = {"kind": "evaluate", "model": "none@1.0.0", "scenes": [{"scene": api.scene()}]}
    assert api.post("/v1/jobs", json=evaluate).status_code == 404
    assert api.get("/v1/jobs").json()["items"] == []


def test_a_scene_that_is_known_is_200(api: Api) -> None:
    scene = api.scene()
    record = api.get(f"/v1/scenes/{scene}").json()
    files = {path: file["sha256"] for path, file in record["files"].items()}
    answer = api.post("/v1/scenes", json={"name": "other", "root": record["root"], "files": files})
    assert (answer.status_code, answer.json()["id"]) == (200, scene)
    missing = api.post("/v1/scenes", json={"name": "s", "root": "a.usda", "files": {"a.usda": "0" * 64}})
    assert (missing.status_code, missing.json()["missing"]) == (409, ["0" * 64])


def test_cancel_and_retry(api: Api) -> None:
    job = api.job()
    assert api.post(f"/v1/jobs/{job}/retry").status_code == 409
    assert api.post(f"/v1/jobs/{job}/cancel").json()["state"] == "cancelled"
    retried = api.post(f"/v1/jobs/{job}/retry").json()
    assert (retried["state"], retried["attempt"]) == ("queued", 2)


def _all(api: Api, path: str) -> list[Any]:
    found: list[Any] = []
    while True:
        answer = api.get(path, "admin")
        assert answer.status_code == 200, answer.text
        found += answer.json()["items"]
        assert len(found) < 1000
        if "next" not in answer.links:
            return found
        path = answer.links["next"]["url"]


@pytest.fixture
def full(database_url: str, tmp_path: Path) -> Api:
    """A service with several of everything."""
    return _filled(tmp_path, database_url)


@pytest.fixture(scope="module", params=["sqlite", "postgresql"])
def read(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Api:
    """The same for tests that change nothing."""
    url = ""
    if request.param == "postgresql":
        server: Postgres = request.getfixturevalue("postgres")
        url = server.new_database()
    return _filled(tmp_path_factory.mktemp("read"), url, rate=1e6, burst=10**6)


def _filled(folder: Path, url: str, **settings: Any) -> Api:
    api = Api(folder, url, **settings)
    for index in range(3):
        api.job(name=f"glass-{index}")
        api.scene(f"#usda 1.0\n# {index}\n")
        api.service.measured.record_dataset({"seed": index}, [shard()], None)
        api.version(folder / f"bundle{index}", str(index))
    names = [str(index) for index in range(5)]
    api.service.measured.record("evaluate/a", [measurement(view=n) for n in names], {"bottles": HASH}, None, None)
    job = api.get("/v1/jobs").json()["items"][0]["id"]
    rows = [
        {"job_id": job, "stage": stage, "name": name, "position": int(name), "artifact": f"{stage}/{HASH}"}
        | {"task": {}, "state": "queued"}
        for stage in ("label", "render")
        for name in names
    ]
    with api.service.database.write() as connection:
        connection.execute(tables.tasks.insert(), rows)
    return api


def test_lists_are_the_same_in_pages_of_any_size(read: Api) -> None:
    job = read.get("/v1/jobs").json()["items"][0]["id"]
    for path, count in {
        "/v1/jobs": 3,
        f"/v1/jobs/{job}/tasks": 10,
        "/v1/scenes": 4,
        "/v1/datasets": 3,
        "/v1/measurements": 5,
        "/v1/models": 1,
        "/v1/models/glass/versions": 3,
        "/v1/keys": 4,
    }.items():
        whole = _all(read, path)
        assert len(whole) == count, path
        assert _all(read, f"{path}?limit=1") == whole, path
        assert _all(read, f"{path}?limit=2") == whole, path


def test_what_comes_meanwhile_moves_no_page(full: Api) -> None:
    first = full.get("/v1/jobs?limit=2")
    before = [job["id"] for job in _all(full, "/v1/jobs")]
    full.job(name="new")
    rest = full.get(first.links["next"]["url"]).json()["items"]
    assert [job["id"] for job in [*first.json()["items"], *rest]] == before


@pytest.mark.parametrize("cursor", ["x", "!!!!", "bnVsbA==", "WzEsMl0=", "WzEuMCwiJyBvciAxPTEiXQ==", "W05hTiwiYSJd"])
def test_a_cursor_of_something_else_is_refused(shared: Api, cursor: str) -> None:
    for path in ("/v1/jobs", "/v1/scenes", "/v1/datasets", "/v1/measurements"):
        answer = shared.get(path, params={"cursor": cursor})
        assert (answer.status_code, answer.json()["type"]) == (422, "/v1/problems/invalid")


def test_filters_are_kept_in_the_link(read: Api) -> None:
    assert [job["name"] for job in _all(read, "/v1/jobs?name=glass-1&limit=1")] == ["glass-1"]
    link = read.get("/v1/measurements?technique=kbuffer&limit=2").links["next"]["url"]
    assert "technique=kbuffer" in link
    assert link.startswith("/v1/measurements?")


@pytest.mark.parametrize(
    ("query", "count"),
    [
        ("scene=bottles", 5),
        (f"scene={HASH}", 5),
        ("technique=none", 0),
        ("budget=1", 5),
        ("since=2020-01-01T00:00:00Z", 5),
        ("until=2020-01-01T00:00:00%2B02:00", 0),
    ],
)
def test_measurements_by(read: Api, query: str, count: int) -> None:
    assert len(read.get(f"/v1/measurements?{query}").json()["items"]) == count


@pytest.mark.parametrize("query", ["since=0.5", "since=yesterday", "budget=nan", "budget=inf", "scene=%00", "job=x"])
def test_filters_that_mean_nothing(shared: Api, query: str) -> None:
    assert shared.get(f"/v1/measurements?{query}").status_code == 422


def test_aliases_move_and_come_back_with_their_history(full: Api) -> None:
    path = "/v1/models/glass/aliases/champion"
    for version in ("1.0.0", "1.1.0"):
        answer = full.request("PUT", path, "publish", json={"version": version, "reason": f"to {version}"})
        assert answer.json()["aliases"] == {"champion": version}
    back = full.post(f"{path}/rollback", "publish", json={"reason": "worse"}).json()
    assert back["aliases"] == {"champion": "1.0.0"}
    assert [(move["after"], move["why"]) for move in back["history"]][:2] == [("1.0.0", "worse"), ("1.1.0", "to 1.1.0")]
    publisher = next(key.id for key in full.service.keys.list() if key.name == "publish")
    assert {move["who"] for move in back["history"]} == {publisher}
    assert full.get("/v1/models/glass").json() == {
        "name": "glass",
        "latest": "1.2.0",
        "aliases": {"champion": "1.0.0"},
        "versions": 3,
    }
    by_alias = full.get("/v1/models/glass/versions/champion").json()
    assert by_alias == full.get("/v1/models/glass/versions/1.0.0").json()
    assert by_alias["public_key"] in full.get("/v1/signing-keys").json()["keys"]
    assert full.get("/v1/models/glass/versions/9.9.9").status_code == 404
    assert full.get("/v1/models/none/versions").status_code == 404
    assert full.get("/v1/models/none/aliases").status_code == 404
    unknown = full.request("PUT", path, "publish", json={"version": "9.9.9", "reason": "x"})
    assert unknown.status_code == 404


def test_what_an_alias_means_is_stated_anew_at_every_question(full: Api) -> None:
    alias, path = "/v1/models/glass/aliases/champion", "/v1/models/glass/pointers/champion"
    assert full.get(path).status_code == 404
    assert full.request("PUT", alias, "publish", json={"version": "1.1.0", "reason": "first"}).status_code == 200
    for headers in ({}, {"If-None-Match": "*"}, {"If-Modified-Since": "Fri, 01 Jan 2100 00:00:00 GMT"}):
        answer = full.get(path, headers=headers)
        assert (answer.status_code, answer.headers["cache-control"]) == (200, "no-store")
        assert "etag" not in answer.headers
    record = answer.json()
    statement = json.loads(record["statement"])
    assert (statement["selector"], statement["version"]) == ("champion", "1.1.0")
    assert verify(record["public_key"], record["statement"], record["signature"])
    assert [record["public_key"]] == full.get("/v1/signing-keys").json()["keys"]
    assert json.loads(full.get("/v1/models/glass/pointers/1.0.0").json()["statement"])["serial"] == 0
    back = full.post(f"{alias}/rollback", "publish", json={"reason": "there is none"})
    assert back.status_code == 409
    assert full.request("PUT", alias, "publish", json={"version": "1.0.0", "reason": "older"}).status_code == 200
    assert json.loads(full.get(path).json()["statement"])["serial"] > statement["serial"]


def test_a_version_s_etag_changes_with_what_its_record_says(full: Api) -> None:
    alias, path = "/v1/models/glass/aliases/champion", "/v1/models/glass/versions/champion"
    assert full.request("PUT", alias, "publish", json={"version": "1.1.0", "reason": "first"}).status_code == 200
    first = full.get(path)
    tag = first.headers["etag"]
    for header in (tag, f"W/{tag}", f'"other", {tag}', "*"):
        same = full.get(path, headers={"If-None-Match": header})
        assert (same.status_code, same.content, same.headers["etag"]) == (304, b"", tag)
    assert full.get(path, headers={"If-None-Match": '"other"'}).json() == first.json()
    moved = {"version": "1.0.0", "reason": "better"}
    assert full.request("PUT", alias, "publish", json=moved).status_code == 200
    after = full.get(path, headers={"If-None-Match": tag})
    assert (after.status_code, after.json()["version"]) == (200, "1.0.0")
    assert after.headers["etag"] != tag


def test_keys_show_no_secret(api: Api) -> None:
    made = api.post("/v1/keys", "admin", json={"name": "ci", "scopes": ["submit"], "expires": "2100-01-01T00:00:00Z"})
    assert made.json()["key"]["expires"] == "2100-01-01T00:00:00.000000Z"
    assert made.headers["cache-control"] == "no-store"
    secret = made.json()["secret"]
    assert secret not in api.get("/v1/keys", "admin").text
    past = api.post("/v1/keys", "admin", json={"name": "ci", "scopes": ["read"], "expires": "2000-01-01T00:00:00Z"})
    assert past.status_code == 422


def test_workers(api: Api) -> None:
    api.job()
    found = api.get("/v1/workers").json()
    assert {queue["role"]: queue["queued"] for queue in found["queues"]}["jobs"] == 1
    assert found["executors"] == []


def test_a_shard_is_read_from_the_artifact_it_lies_in(api: Api) -> None:
    address = Address("label", "v", ("a",), {})
    with api.service.storage.store.put(address) as folder:
        (folder / "shard.safetensors").write_bytes(b"rows")
    sha256 = hashlib.sha256(b"rows").hexdigest()
    there = shard().model_copy(update={"artifact": f"label/{address.key}", "sha256": sha256, "bytes": 4})
    dataset = api.service.measured.record_dataset({"seed": 0}, [there], None)
    answer = api.get(f"/v1/datasets/{dataset.id}/shards/{sha256}")
    assert (answer.status_code, answer.content) == (200, b"rows")
    assert api.get(f"/v1/datasets/{dataset.id}/shards/{HASH}").status_code == 404
    api.service.storage.store.remove(there.artifact)
    answer = api.get(f"/v1/datasets/{dataset.id}/shards/{sha256}")
    assert answer.status_code == 404
    assert "again" in answer.json()["remedy"]


def _job(**changes: Any) -> dict[str, Any]:
    return {"kind": "build", "name": "glass", "width": 64, "height": 48, **changes}


@pytest.mark.parametrize(
    ("scope", "asked", "status", "promote"),
    [
        ("submit", None, 202, "never"),
        ("submit", "never", 202, "never"),
        ("submit", "if-better", 403, None),
        ("admin", None, 202, "if-better"),
        ("admin", "if-better", 202, "if-better"),
    ],
)
def test_a_promotion_needs_the_scope_for_it(
    shared: Api, scope: str, asked: str | None, status: int, promote: str | None
) -> None:
    body = _job(scenes=[{"scene": shared.scene()}], **({} if asked is None else {"promote": asked}))
    answer = shared.post("/v1/jobs", scope, json=body)
    assert answer.status_code == status, answer.text
    if promote is not None:
        assert answer.json()["spec"]["promote"] == promote


@pytest.mark.parametrize("eye", [[0, 0, 1], [1e308, 1e185, 0]])
def test_a_view_without_direction_is_refused_at_once(shared: Api, eye: list[float]) -> None:
    view = {"eye": eye, "target": [0, 0, 1], "up": [0, 1, 0], "fov": 40}
    answer = shared.post("/v1/jobs", json=_job(scenes=[{"scene": "scn_" + "0" * 32, "views": [view]}]))
    assert answer.status_code == 422
    assert "no direction" in answer.text


def test_a_scene_is_advised_on_by_what_was_measured_on_it(api: Api) -> None:
    scene = api.scene()
    answer = api.get(f"/v1/scenes/{scene}/advice")
    assert (answer.status_code, answer.json()["type"]) == (404, "/v1/problems/not-found")
    dear = measurement(total_fragments=2000, total_bytes=6000, mse=1e-4)
    api.service.measured.record("evaluate/a", [dear], {"bottles": api.service.scenes.get(scene).digest}, None, None)
    fits = api.get(f"/v1/scenes/{scene}/advice").json()["choice"]
    assert (fits["verdict"], fits["chosen"]["technique"], fits["size"]) == (
        "exact",
        "sbuffer",
        {"width": 10, "height": 10},
    )
    tight = api.get(f"/v1/scenes/{scene}/advice?memory=8KiB").json()
    assert (tight["choice"]["verdict"], tight["choice"]["chosen"]["technique"]) == ("technique", "kbuffer")
    assert "Use fixed k (kbuffer), budget 1, density tail" in tight["text"][0]
    large = api.get(f"/v1/scenes/{scene}/advice?memory=8KiB&size=1920x1080").json()
    assert large["choice"]["verdict"] == "none"
    assert api.get(f"/v1/scenes/{scene}/advice?memory=8").status_code == 422
