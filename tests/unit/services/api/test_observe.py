from __future__ import annotations

import re

import pytest
import structlog
from fastapi.testclient import TestClient
from support.api import Api, build_spec

from services.api.application import create_app
from services.api.server import is_loopback, make_server


def test_a_request_id_is_made_or_repeated(api: Api) -> None:
    assert re.fullmatch(r"[0-9a-f]{32}", api.get("/v1/jobs").headers["x-request-id"])
    assert api.get("/v1/jobs", headers={"X-Request-ID": "build-7.a_b"}).headers["x-request-id"] == "build-7.a_b"
    for bad in ("a b", "a" * 65, "a;b", '"'):
        assert api.get("/v1/jobs", headers={"X-Request-ID": bad}).headers["x-request-id"] != bad


@pytest.mark.parametrize(
    ("host", "status"),
    [
        *(("localhost", 200), ("127.0.0.1:8035", 200), ("[::1]:8035", 200), ("[::1]", 200), ("LocalHost:1", 200)),
        *(("evil.example", 421), ("localhost.evil.example", 421), ("evil.example:8035", 421), ("", 421)),
    ],
)
def test_only_its_own_names_are_answered(shared: Api, host: str, status: int) -> None:
    answer = shared.get("/v1/jobs", headers={"Host": host})
    assert answer.status_code == status
    if status == 421:
        assert answer.json()["type"] == "/v1/problems/misdirected"


def test_names_can_be_given(api: Api) -> None:
    for hosts, status in ((("diaphane.example",), 200), (("*",), 200), (("other.example",), 421)):
        client = TestClient(create_app(api.service, hosts=hosts))
        assert client.get("/v1/health/live", headers={"Host": "diaphane.example:80"}).status_code == status


def test_a_loopback_server_answers_for_loopback_names_only(api: Api) -> None:
    assert [is_loopback(host) for host in ("127.0.0.1", "::1", "localhost", "0.0.0.0", "example.org")] == [
        *(True, True, True),
        *(False, False),
    ]
    for host, status in (("127.0.0.1", 421), ("0.0.0.0", 200)):
        client = TestClient(make_server(api.service, host, 0).config.app)  # type: ignore[arg-type]
        assert client.get("/v1/health/live", headers={"Host": "a.example"}).status_code == status


def test_every_answer_has_the_security_headers(api: Api) -> None:
    for answer in (api.get("/v1/jobs"), api.get("/nothing"), api.get("/v1/problems", None), api.get("/v1/jobs", None)):
        assert answer.headers["x-content-type-options"] == "nosniff"
        assert answer.headers["x-frame-options"] == "DENY"
        assert answer.headers["referrer-policy"] == "no-referrer"
        assert "default-src 'none'" in answer.headers["content-security-policy"]
    assert api.get("/v1/jobs").headers["cache-control"] == "no-store"


def test_requests_are_logged_and_secrets_are_not(api: Api) -> None:
    scene = api.scene()
    with structlog.testing.capture_logs(processors=[structlog.contextvars.merge_contextvars]) as lines:
        made = api.post("/v1/keys", "admin", json={"name": "ci", "scopes": ["read"]}).json()
        api.get("/v1/jobs?name=secretname", headers={"X-Request-ID": "r-1"})
        api.post("/v1/jobs", json=build_spec(scene), headers={"Idempotency-Key": "idempotent-secret"})
        api.get("/v1/jobs", None, headers={"Authorization": "Bearer wrong-secret"})
        api.get("/v1/jobs", None, headers={"Authorization": f"Bearer {made['secret']}"})
    line = next(line for line in lines if line.get("request_id") == "r-1")
    reader = next(key.id for key in api.service.keys.list() if key.name == "read")
    assert (line["method"], line["path"], line["status"], line["key"]) == ("GET", "/v1/jobs", 200, reader)
    text = str(lines)
    for secret in (*api.secrets.values(), made["secret"], "wrong-secret", "secretname", "idempotent-secret", "Bearer"):
        assert secret not in text
    assert [line["status"] for line in lines if line["event"] == "request"] == [201, 200, 202, 401, 200]


def test_an_unexpected_error_is_logged_under_the_request_id(api: Api, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(_: object) -> None:
        raise RuntimeError("broken")

    monkeypatch.setattr(type(api.service.registry), "models", fail)
    with structlog.testing.capture_logs(processors=[structlog.contextvars.merge_contextvars]) as lines:
        api.get("/v1/models", headers={"X-Request-ID": "r-2"})
    failure = next(line for line in lines if line["log_level"] == "error")
    assert (failure["request_id"], failure["event"]) == ("r-2", "unexpected error")


def test_metrics(api: Api) -> None:
    job = api.job()
    api.get(f"/v1/jobs/{job}")
    api.get("/nothing/at/all")
    api.request("BREW", "/v1/jobs")
    text = api.get("/v1/metrics").text
    assert 'diaphane_http_requests_total{method="GET",route="/v1/jobs/{job_id}",status="200"} 1.0' in text
    assert 'diaphane_http_requests_total{method="GET",route="other",status="404"} 1.0' in text
    assert 'method="other"' in text
    assert "BREW" not in text
    assert 'diaphane_http_request_seconds_bucket{le="0.5",method="POST",route="/v1/jobs"} 1.0' in text
    assert 'diaphane_queue_depth{role="jobs"} 1.0' in text
    assert 'diaphane_jobs{state="queued"} 1.0' in text
    assert 'diaphane_executors_alive{role="render"} 0.0' in text
    assert "diaphane_event_listeners 0.0" in text
    assert "diaphane_database_up 1.0" in text
    assert 'diaphane_http_response_bytes_total{method="GET",route="/v1/jobs/{job_id}"}' in text


def test_ready_names_roles_without_a_worker(api: Api) -> None:
    answer = api.get("/v1/health/ready", None)
    assert answer.status_code == 200
    assert answer.json()["missing_roles"] == ["jobs", "render", "label", "train"]
