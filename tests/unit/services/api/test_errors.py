from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

import httpx
import pytest
from support.api import Api, build_spec

from schemas.limits import LIMITS
from services.database import Database
from services.problems import CATALOGUE, Refusal
from services.registry import Registry

JSON = {"Content-Type": "application/json"}


def _problem(answer: Any) -> str:
    assert answer.headers["content-type"] == "application/problem+json"
    document = answer.json()
    assert document["status"] == answer.status_code
    assert document["request_id"] == answer.headers["x-request-id"]
    assert document["remedy"]
    return str(document["type"]).rpartition("/")[2]


def test_every_problem_is_explained(shared: Api) -> None:
    listed = shared.get("/v1/problems", None).json()["items"]
    assert [one["slug"] for one in listed] == list(CATALOGUE)
    for slug in CATALOGUE:
        assert shared.get(f"/v1/problems/{slug}", None).json()["explanation"]
        assert Refusal(slug).document().type == f"/v1/problems/{slug}"
    assert _problem(shared.get("/v1/problems/none", None)) == "not-found"


def test_an_address_that_does_not_exist(shared: Api) -> None:
    for path in ("/nothing", "/v1/jobs/", "/v1/jobs/nonsense", "/v1/models/UPPER"):
        answer = shared.get(path)
        assert (answer.status_code, _problem(answer)) == (404, "not-found")


def test_a_method_that_does_not_exist_says_which_do(shared: Api) -> None:
    answer = shared.request("PUT", "/v1/keys")
    assert (_problem(answer), answer.headers["allow"]) == ("method-not-allowed", "GET, POST")
    answer = shared.request("POST", "/v1/blobs/sha256/" + "0" * 64)
    assert answer.headers["allow"] == "GET, HEAD"


def test_places_in_the_request_are_named_without_repeating_what_was_sent(shared: Api) -> None:
    answer = shared.post("/v1/jobs", json=build_spec("scn_secret", budgets=["secret"]))
    assert _problem(answer) == "invalid"
    assert {one["at"] for one in answer.json()["errors"]} >= {"body.scenes.0.scene", "body.budgets.0"}
    assert "secret" not in answer.text
    assert _problem(shared.get("/v1/jobs?limit=201")) == "invalid"


@pytest.mark.parametrize(
    ("body", "why"),
    [
        (b"{", "not JSON"),
        (b"", "not JSON"),
        (b"[" * 100_000, "nested"),
        (b'{"a":' * 17 + b"1" + b"}" * 17, "nested"),
        (b'{"g": NaN}', "NaN"),
        (b'{"g": 1e999}', "infinity"),
        (b'{"g": -Infinity}', "infinity"),
        (b'{"name": "a", "name": "b"}', "twice"),
        (b'{"name": "\xff"}', "UTF-8"),
        (b'{"name": "\\ud800"}', "surrogate"),
        (b'{"name": "a\\u0000"}', "NUL"),
        (b'{"\\u0000": 1}', "NUL"),
        (b'{"seed": ' + b"1" * 5000 + b"}", "not JSON"),
    ],
)
def test_a_body_that_is_not_well_formed(shared: Api, body: bytes, why: str) -> None:
    answer = shared.post("/v1/jobs", content=body, headers=JSON)
    assert _problem(answer) == "malformed"
    assert why in answer.json()["detail"]


def test_brackets_in_texts_are_not_nesting_and_whole_numbers_are_integers(api: Api) -> None:
    files = {"a.usda": "0" * 64}
    answer = api.post("/v1/scenes", json={"name": '[[[[[[[[[[[[[[[[[["\\', "root": "a.usda", "files": files})
    assert _problem(answer) == "blobs-missing"
    answer = api.post("/v1/uploads", content=b'{"sha256": "%s", "bytes": 5.0}' % (b"0" * 64), headers=JSON)
    assert answer.status_code == 201
    answer = api.post("/v1/uploads", content=b'{"sha256": "%s", "bytes": "5"}' % (b"0" * 64), headers=JSON)
    assert _problem(answer) == "invalid"


def test_a_body_of_another_type(api: Api) -> None:
    assert _problem(api.post("/v1/jobs", content=b"{}")) == "unsupported-media-type"
    assert _problem(api.post("/v1/jobs", content=b"{}", headers={"Content-Type": "text/json"})) == (
        "unsupported-media-type"
    )
    job = build_spec(api.scene())
    headers = {"Content-Type": "Application/JSON; charset=utf-8"}
    assert api.post("/v1/jobs", content=json.dumps(job), headers=headers).status_code == 202


def test_a_body_is_limited_with_and_without_its_length(api: Api) -> None:
    big = b" " * (LIMITS.body_bytes + 1)
    assert _problem(api.post("/v1/jobs", content=big, headers=JSON)) == "too-large"
    read = 0

    def endless() -> Iterator[bytes]:
        nonlocal read
        while True:
            read += 1 << 16
            yield b" " * (1 << 16)

    with api.served() as url, httpx.Client(timeout=60.0) as client:
        headers = {**JSON, **api.headers()}
        try:
            answer = client.post(f"{url}/v1/jobs", content=endless(), headers=headers, timeout=10.0)
        except httpx.WriteError:
            return  # it closed the connection while we were talking
        assert _problem(answer) == "too-large"
    assert read < 64 * LIMITS.body_bytes


def test_an_error_of_the_service_tells_nothing(api: Api, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(_: Registry) -> None:
        raise RuntimeError("/secret/path")

    monkeypatch.setattr(Registry, "models", fail)
    answer = api.get("/v1/models")
    assert (answer.status_code, _problem(answer)) == (500, "internal")
    assert "secret" not in answer.text


def test_a_database_that_is_away_is_no_error_of_the_client(api: Api, monkeypatch: pytest.MonkeyPatch) -> None:
    assert api.get("/v1/health/ready", None).json()["database"]

    def away(_: Database) -> None:
        from sqlalchemy.exc import OperationalError

        raise OperationalError("select", {}, Exception("connection refused to secret:5432"))

    monkeypatch.setattr(Database, "read", away)
    answer = api.get("/v1/jobs")
    assert (answer.status_code, _problem(answer)) == (503, "unavailable")
    assert answer.headers["retry-after"]
    assert "secret" not in answer.text
    monkeypatch.setattr("services.api.health._KEPT_SECONDS", -1.0)
    ready = api.get("/v1/health/ready", None)
    assert (ready.status_code, ready.json()["database"], ready.json()["store"]) == (503, False, True)
    assert api.get("/v1/health/live", None).status_code == 200
