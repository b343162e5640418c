"""What nobody knows here is refused: left out without a word, it would have meant something to whoever sent it."""

from __future__ import annotations

from typing import Any

import pytest
from support.api import Api, build_spec
from support.dashboard import Visitor

from services.api.description import build_document

VIEW = {"eye": [0, 0, 5], "target": [0, 0, 0], "up": [0, 1, 0], "fov": 45}
PLAIN = [path for path, operations in build_document()["paths"].items() if "get" in operations and "{" not in path]


@pytest.mark.parametrize("path", PLAIN)
def test_an_unknown_parameter_is_refused_by_name(shared: Api, path: str) -> None:
    answer = shared.get(f"{path}?lmit=5", "admin")
    assert (answer.status_code, answer.json()["type"]) == (422, "/v1/problems/invalid")
    assert answer.json()["errors"] == [{"at": "query.lmit", "message": "is nothing that is known here"}]


@pytest.mark.parametrize("path", ["/v1/jobs", "/v1/measurements"])
def test_a_parameter_that_is_given_twice_is_refused(shared: Api, path: str) -> None:
    answer = shared.get(f"{path}?limit=5&limit=6")
    assert answer.status_code == 422
    assert answer.json()["errors"] == [{"at": "query.limit", "message": "is given twice"}]
    assert shared.get(f"{path}?limit=5").status_code == 200


def test_of_routes_with_ids_and_of_what_changes_something_too(api: Api) -> None:
    job = api.job()
    for method, path in (
        ("GET", f"/v1/jobs/{job}"),
        ("GET", f"/v1/jobs/{job}/events"),
        ("POST", f"/v1/jobs/{job}/cancel"),
        ("GET", f"/v1/blobs/sha256/{'0' * 64}"),
        ("HEAD", f"/v1/blobs/sha256/{'0' * 64}"),
    ):
        assert api.request(method, f"{path}?force=1").status_code == 422, (method, path)
    assert api.get(f"/v1/jobs/{job}").json()["state"] == "queued"
    # Whoever has no key is told that first.
    assert api.get("/v1/jobs?lmit=5", None).status_code == 401


def test_what_the_demo_asks_for_by_session_too(api: Api) -> None:
    visitor = Visitor(api, "read")
    assert visitor.get("/demo/v1/models?lmit=1").status_code == 422
    assert visitor.get("/demo/v1/models?limit=1").status_code == 200


@pytest.mark.parametrize("change", [{"name": "front"}, {"ortho_height": 3.0}, {"near": 1.0}])
def test_an_unknown_member_of_a_view_is_refused(api: Api, change: dict[str, Any]) -> None:
    scene = api.scene()
    spec = build_spec(scene, scenes=[{"scene": scene, "views": [VIEW, VIEW | change]}])
    answer = api.post("/v1/jobs", json=spec)
    assert answer.status_code == 422
    at = f"body.scenes.0.views.1.{next(iter(change))}"
    assert answer.json()["errors"] == [{"at": at, "message": "is nothing that is known here"}]


def _objects(schema: Any) -> list[dict[str, Any]]:
    found = []
    if isinstance(schema, dict):
        found += [schema] if schema.get("type") == "object" and "properties" in schema else []
        schema = list(schema.values())
    if isinstance(schema, list):
        found += [inner for one in schema for inner in _objects(one)]
    return found


def test_no_body_has_members_that_are_left_out() -> None:
    """The class of it: every object that a route takes is closed, at any depth."""
    document = build_document()
    schemas = document["components"]["schemas"]
    taken = {
        operation["requestBody"]["content"]["application/json"]["schema"]["$ref"].rpartition("/")[2]
        for operations in document["paths"].values()
        for operation in operations.values()
        if "application/json" in operation.get("requestBody", {}).get("content", {})
    }
    seen: set[str] = set()
    while taken - seen:
        name = (taken - seen).pop()
        seen.add(name)
        assert all(one.get("additionalProperties") is False for one in _objects(schemas[name])), name
        taken |= {ref.rpartition("/")[2] for ref in _references(schemas[name])}
    assert {"JobSpec", "SceneUse", "SceneView", "NewKey", "JobBounds"} <= seen


def _references(schema: Any) -> set[str]:
    if isinstance(schema, dict):
        own = {schema["$ref"]} if "$ref" in schema else set()
        return own.union(*map(_references, schema.values()))
    return set().union(*map(_references, schema)) if isinstance(schema, list) else set()


@pytest.mark.parametrize(
    ("alias", "status"), [("beta-", 404), ("be--ta", 200), ("b", 200), ("b" * 40, 200), ("9", 404)]
)
def test_an_alias_that_the_document_allows_is_one(api: Api, tmp_path: Any, alias: str, status: int) -> None:
    api.version(tmp_path / "bundle")
    body = {"version": "1.0.0", "reason": "a test"}
    answer = api.request("PUT", f"/v1/models/glass/aliases/{alias}", "publish", json=body)
    assert answer.status_code == status
