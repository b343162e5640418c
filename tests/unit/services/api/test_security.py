from __future__ import annotations

from pathlib import Path
from typing import Any

import httpx
import pytest
from fastapi import APIRouter
from support.api import Api
from support.dashboard import Visitor

from schemas.service import SCOPES
from services.api import application, routes
from services.api.description import build_document

OPEN = {"/v1/health/live", "/v1/health/ready", "/v1/openapi.json", "/v1/problems", "/v1/problems/{slug}"}
"""The short list of what needs no key."""

PARTS = {
    "job_id": "job_" + "0" * 24,
    "scene_id": "scn_" + "0" * 32,
    "dataset_id": "dst_" + "0" * 32,
    "upload_id": "upl_" + "0" * 24,
    "key_id": "key_" + "0" * 12,
    "webhook_id": "whk_" + "0" * 24,
    "sha256": "0" * 64,
    "name": "glass",
    "alias": "champion",
    "version": "1.0.0",
    "slug": "invalid",
}


def _operations() -> list[tuple[str, str, dict[str, Any]]]:
    document = build_document()
    return [
        (method.upper(), path, operation)
        for path, operations in document["paths"].items()
        for method, operation in operations.items()
    ]


OPERATIONS = _operations()
GUARDED = [(method, path, operation) for method, path, operation in OPERATIONS if path not in OPEN]


@pytest.fixture(scope="module")
def api(tmp_path_factory: pytest.TempPathFactory) -> Api:
    return Api(tmp_path_factory.mktemp("api"), rate=1e6, burst=10**6)


def test_the_document_has_all_routes() -> None:
    assert {path for _, path, _ in OPERATIONS} >= OPEN
    assert len(GUARDED) > 25


@pytest.mark.parametrize(("method", "path"), [(method, path) for method, path, _ in GUARDED])
@pytest.mark.parametrize(
    "headers",
    [{}, {"Authorization": "Bearer dia_000000000000_" + "a" * 43}, {"Authorization": "Basic YTpi"}],
    ids=["none", "unknown", "basic"],
)
def test_nothing_answers_without_a_key(api: Api, method: str, path: str, headers: dict[str, str]) -> None:
    # A body that is no JSON: whoever has no key is not told that.
    answer = api.request(method, path.format_map(PARTS), None, headers=headers, content=b"{")
    assert answer.status_code == 401
    assert answer.headers["www-authenticate"].startswith("Bearer")
    if method != "HEAD":
        assert answer.json()["type"] == "/v1/problems/unauthenticated"


@pytest.mark.parametrize(("method", "path", "operation"), GUARDED)
def test_a_scope_that_does_not_suffice_is_forbidden(
    api: Api, method: str, path: str, operation: dict[str, Any]
) -> None:
    (needed,) = operation["security"][0]["key"]
    sufficient = {"read": set(SCOPES), "submit": {"submit", "admin"}, "publish": {"publish", "admin"}}
    for scope in SCOPES:
        status = api.request(method, path.format_map(PARTS), scope, content=b"{").status_code
        assert (status != 403) == (scope in sufficient.get(needed, {"admin"})), scope


def test_what_changes_something_needs_more_than_read() -> None:
    harmless = {"/v1/blobs/missing"}  # a question that is too long for an address
    for method, path, operation in GUARDED:
        scope = operation["security"][0]["key"][0]
        assert (scope == "read") == (
            (method in ("GET", "HEAD") and not path.startswith(("/v1/keys", "/v1/webhooks"))) or path in harmless
        )


def test_a_route_that_does_not_say_what_it_needs_is_found_at_the_start(
    api: Api, monkeypatch: pytest.MonkeyPatch
) -> None:
    router = APIRouter()
    router.add_api_route("/v1/forgotten", lambda: None, methods=["POST"])
    monkeypatch.setattr(application, "GUARDED", (*routes.GUARDED, router))
    with pytest.raises(TypeError, match="/v1/forgotten"):
        application.create_app(api.service)


def test_a_revoked_key_is_refused_at_once(api: Api) -> None:
    made = api.post("/v1/keys", "admin", json={"name": "ci", "scopes": ["read"]})
    assert made.status_code == 201
    headers = {"Authorization": f"Bearer {made.json()['secret']}"}
    assert api.get("/v1/jobs", None, headers=headers).status_code == 200
    assert api.request("DELETE", f"/v1/keys/{made.json()['key']['id']}").status_code == 204
    assert api.get("/v1/jobs", None, headers=headers).status_code == 401


def test_an_administrator_cannot_lock_itself_out(api: Api) -> None:
    own = next(key for key in api.service.keys.list() if key.name == "admin")
    assert api.request("DELETE", f"/v1/keys/{own.id}").status_code == 409


def test_a_key_may_ask_only_so_often(tmp_path: Path) -> None:
    api = Api(tmp_path, rate=0.001, burst=3)
    answers = [api.get("/v1/jobs") for _ in range(4)]
    assert [answer.status_code for answer in answers] == [200, 200, 200, 429]
    assert [answer.headers["ratelimit"].split(";")[1] for answer in answers] == ["r=2", "r=1", "r=0", "r=0"]
    assert answers[0].headers["ratelimit-policy"] == '"key";q=3;w=3000'
    assert int(answers[3].headers["retry-after"]) > 900
    assert answers[3].json()["type"] == "/v1/problems/too-many-requests"
    assert api.get("/v1/jobs", "submit").status_code == 200


GUESS = f"dia_000000000000_{'a' * 43}"
"""Of the form of a secret, and nobody's."""


def _wrong(api: Api, secret: str, times: int) -> list[int]:
    headers = {"Authorization": f"Bearer {secret}"}
    return [api.get("/v1/jobs", None, headers=headers).status_code for _ in range(times)]


def test_an_address_may_guess_only_so_often(tmp_path: Path) -> None:
    assert _wrong(Api(tmp_path, rate=0.001, burst=8), GUESS, 4) == [401, 401, 429, 429]


def test_a_flood_of_wrong_keys_stops_nobody_at_the_same_address_who_is_right(tmp_path: Path) -> None:
    api = Api(tmp_path, rate=0.001, burst=20)
    signed_in = Visitor(api, "read")
    known = api.secrets["submit"]
    assert api.get("/v1/jobs", "submit").status_code == 200
    assert _wrong(api, f"{known[:17]}{'a' * 43}", 30)[-1] == 429
    assert _wrong(api, GUESS, 3) == [429] * 3
    assert api.get("/v1/jobs", "submit").status_code == 200
    assert api.get("/v1/jobs", "read").status_code == 200  # not heard of before
    assert signed_in.get("/jobs").status_code == 200
    assert Visitor(api, "publish").get("/jobs").status_code == 200  # a new session
    again = Api(tmp_path, rate=0.001, burst=20)
    again.secrets = api.secrets
    assert again.get("/v1/jobs", "publish").status_code == 200  # after a restart


def test_what_is_no_secret_or_was_one_is_no_guess(tmp_path: Path) -> None:
    """A variable that is not set, a key that was revoked on a build server: neither looks for a key."""
    api = Api(tmp_path, rate=0.001, burst=8)
    record, secret = api.service.keys.create("old", ["read"])
    api.service.keys.revoke(record.id)
    for wrong in ("$DIAPHANE_KEY", secret):
        assert _wrong(api, wrong, 6) == [401] * 6


def test_who_asks_is_what_the_connection_says(tmp_path: Path) -> None:
    """`X-Forwarded-For` costs nothing to write: with another address each time nobody would ever be counted."""
    api = Api(tmp_path, rate=0.001, burst=8)
    with api.served() as url, httpx.Client(timeout=60.0) as client:
        statuses = [
            client.get(
                f"{url}/v1/jobs", headers={"Authorization": f"Bearer {GUESS}", "X-Forwarded-For": f"203.0.113.{n}"}
            ).status_code
            for n in range(4)
        ]
    assert statuses == [401, 401, 429, 429]


def test_a_proxy_that_was_named_is_believed(tmp_path: Path) -> None:
    api = Api(tmp_path, rate=0.001, burst=8)
    with api.served(proxies=("127.0.0.0/8",)) as url, httpx.Client(timeout=60.0) as client:
        statuses = [
            client.get(
                f"{url}/v1/jobs",
                headers={"Authorization": f"Bearer {GUESS}", "X-Forwarded-For": f"198.51.100.{n}, 203.0.113.7"},
            ).status_code
            for n in range(4)
        ]
    assert statuses == [401, 401, 429, 429]  # what the proxy itself wrote counts, not what it was sent
