"""Webhooks: what is told to whom, when it is tried again, by which process, and where it never leads."""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler
from pathlib import Path
from typing import Any

import pytest
import sqlalchemy as sa
from support.api import Api
from support.receiver import LOOPBACK, Receiver, receiver

from schemas.limits import LIMITS
from schemas.problem import ExitCode, Problem
from schemas.service import ProblemDocument
from schemas.webhook import WEBHOOK_EVENTS, WebhookEvent
from services.database import Database, open_database, tables
from services.engine import states
from services.retention import sweep
from services.webhooks import addresses, outbox, queue
from services.webhooks.addresses import networks_of
from services.webhooks.deliverer import Deliverer
from services.webhooks.hooks import Webhooks
from services.webhooks.schedule import Schedule
from services.webhooks.sender import ANSWER_BYTES, Outcome, send

NETWORKS = networks_of(LOOPBACK)
SOON = Schedule(attempts=3, first_seconds=0.01, factor=1.0, jitter=0.0)


@pytest.fixture
def there() -> Iterator[Receiver]:
    with receiver() as found:
        yield found


@pytest.fixture
def database(database_url: str) -> Iterator[Database]:
    opened = open_database(database_url)
    yield opened
    opened.close()


@pytest.fixture
def webhooks(database: Database) -> Webhooks:
    return Webhooks(database, NETWORKS)


def _hear(webhooks: Webhooks, url: str, *events: WebhookEvent) -> tuple[str, str]:
    record, secret = webhooks.create(url, events or WEBHOOK_EVENTS, "key_000000000000")
    return record.id, secret


def _states(webhooks: Webhooks, webhook_id: str) -> list[str]:
    return [delivery.state for delivery in webhooks.deliveries(webhook_id)]


def _make_due(database: Database) -> None:
    with database.write() as connection:
        connection.execute(tables.deliveries.update().values(due=0.0))


def test_a_delivery_that_failed_comes_again_with_the_same_id_and_is_signed_anew(
    database: Database, webhooks: Webhooks, there: Receiver
) -> None:
    webhook_id, secret = _hear(webhooks, f"{there.url}/hook?token=1")
    webhooks.test(webhook_id)
    there.answers += [500, 302]
    deliverer = Deliverer(database, NETWORKS, SOON)
    for _ in range(3):
        _make_due(database)
        assert deliverer.deliver() == 1
    assert deliverer.deliver() == 0
    assert {message.path for message in there.messages} == {"/hook?token=1"}  # a redirect leads nowhere
    assert len({message.headers["webhook-id"] for message in there.messages}) == 1
    assert [message.verified(secret)["type"] for message in there.messages] == ["webhook.test"] * 3
    (delivery,) = webhooks.deliveries(webhook_id)
    assert (delivery.state, delivery.attempts, delivery.status, delivery.problem) == ("delivered", 3, 204, None)
    assert delivery.id == there.messages[0].headers["webhook-id"]


def test_what_always_fails_is_given_up(database: Database, webhooks: Webhooks, there: Receiver) -> None:
    webhook_id, _ = _hear(webhooks, there.url)
    webhooks.test(webhook_id)
    there.answers += [503] * 5
    deliverer = Deliverer(database, NETWORKS, SOON)
    for attempt in range(1, 4):
        assert deliverer.deliver() == 1
        (delivery,) = webhooks.deliveries(webhook_id)
        assert (delivery.attempts, delivery.status, delivery.problem) == (attempt, 503, "The receiver answered 503.")
        assert (delivery.next_attempt is None, delivery.finished is None) == (attempt == 3, attempt < 3)
        _make_due(database)
    assert (delivery.state, deliverer.deliver()) == ("failed", 0)


def test_a_receiver_that_is_gone_is_asked_once(database: Database, webhooks: Webhooks, there: Receiver) -> None:
    webhook_id, _ = _hear(webhooks, there.url)
    webhooks.test(webhook_id)
    there.answers.append(410)
    assert Deliverer(database, NETWORKS, SOON).deliver() == 1
    assert _states(webhooks, webhook_id) == ["failed"]


def test_a_webhook_hears_only_of_what_it_chose(database: Database, webhooks: Webhooks) -> None:
    some, _ = _hear(webhooks, "https://ci.example.org/", "scene.rejected")
    every, _ = _hear(webhooks, "https://ci.example.org/")
    with database.write() as connection:
        scene = sa.select(
            sa.literal("scn_1").label("id"), sa.literal("a").label("name"), sa.literal("k").label("created_by")
        )
        problem = ProblemDocument(type="/v1/problems/scene-url", title="No.", status=422)
        outbox.scene_rejected(connection, connection.execute(scene).one(), problem)
        job = {"id": "job_1", "kind": "build", "name": "glass", "attempt": 1, "submitted_by": "k"}
        row = connection.execute(sa.select(*(sa.literal(value).label(name) for name, value in job.items()))).one()
        outbox.job_ended(connection, row, "cancelled", None, None)
    assert [delivery.event for delivery in webhooks.deliveries(some)] == ["scene.rejected"]
    assert {delivery.event for delivery in webhooks.deliveries(every)} == {"scene.rejected", "job.cancelled"}


def test_each_delivery_is_leased_to_one_process(database: Database, database_url: str, webhooks: Webhooks) -> None:
    ids = [_hear(webhooks, f"https://ci.example.org/{number}")[0] for number in range(6)]
    for webhook_id in ids * 3:
        webhooks.test(webhook_id)
    others = [open_database(database_url) for _ in range(3)]
    found: list[str] = []

    def work(own: Database) -> None:
        while due := queue.claim(own):
            for claimed in due:
                found.append(claimed.id)
                assert queue.settle(own, claimed, Outcome(204), None)

    threads = [threading.Thread(target=work, args=(own,)) for own in others]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for own in others:
        own.close()
    while due := queue.claim(database):  # what was locked by another one at the last look of all
        found += [claimed.id for claimed in due if queue.settle(database, claimed, Outcome(204), None)]
    assert len(found) == len(set(found)) == 18
    assert webhooks.counts() == {"delivered": 18}


def test_what_a_dead_process_had_is_tried_by_another_one_whose_word_counts(
    database: Database, webhooks: Webhooks
) -> None:
    webhook_id, _ = _hear(webhooks, "https://ci.example.org/")
    webhooks.test(webhook_id)
    (dead,) = queue.claim(database, lease=0.0)
    (living,) = queue.claim(database)
    assert (living.id, living.attempt, dead.attempt) == (dead.id, 2, 1)
    assert queue.claim(database) == []  # as long as the lease lasts
    assert not queue.settle(database, dead, Outcome(204), None)
    assert _states(webhooks, webhook_id) == ["waiting"]
    assert queue.settle(database, living, Outcome(None, "No."), None)
    assert not queue.settle(database, dead, Outcome(204), None)
    assert _states(webhooks, webhook_id) == ["failed"]


def test_a_receiver_that_is_away_holds_up_its_own_deliveries_only(
    database: Database, webhooks: Webhooks, there: Receiver
) -> None:
    silent, _ = _hear(webhooks, "http://127.0.0.1:1/")
    for _ in range(5):
        webhooks.test(silent)
    heard, _ = _hear(webhooks, there.url)
    webhooks.test(heard)
    assert Deliverer(database, NETWORKS).deliver() == 2
    assert _states(webhooks, heard) == ["delivered"]


def test_what_ends_is_told_in_the_transaction_in_which_it_ends(tmp_path: Path) -> None:
    api = Api(tmp_path, webhook_networks=LOOPBACK)
    webhook_id, _ = _hear(api.service.webhooks, "https://ci.example.org/")
    cancelled = api.job()
    api.service.jobs.cancel(cancelled)
    other = api.job(name="other")
    api.move(other, "running")
    problem = ProblemDocument(type="/v1/problems/check-failed", title="A check failed.", status=422)
    for _ in range(2):  # what ended ends once
        states.end_job(api.service.database, None, other, 1, "failed", problem=problem)
    sha256 = api.service.storage.blobs.put_bytes(b"#usda 1.0\n# bad\n").sha256
    scene, _ = api.service.scenes.create("bad", "scene.usda", {"scene.usda": sha256}, "key_000000000000")
    for _ in range(2):
        api.service.scenes.resolve_check(scene.id, None, problem)
    api.version(tmp_path / "bundle")
    for alias in ("champion", "champion", "stable"):
        api.service.registry.promote("glass", "1.0.0", "better", alias, who="key_1")
    with api.service.database.read() as connection:
        bodies = connection.execute(sa.select(tables.deliveries.c.event, tables.deliveries.c.body)).all()
    told = {event: json.loads(body) for event, body in bodies}
    assert sorted(event for event, _ in bodies) == ["job.cancelled", "job.failed", "model.champion", "scene.rejected"]
    assert told["job.cancelled"]["data"]["id"] == cancelled
    assert told["job.failed"]["data"]["problem"]["title"] == "A check failed."
    assert told["scene.rejected"]["data"]["id"] == scene.id
    assert told["model.champion"]["data"] == {
        "name": "glass",
        "version": "1.0.0",
        "before": None,
        "who": "key_1",
        "why": "better",
    }
    assert len(_states(api.service.webhooks, webhook_id)) == 4


@pytest.mark.parametrize(
    "meaning", [["10.0.0.5"], ["169.254.169.254"], ["127.0.0.1"], ["::1"], ["8.8.8.8", "10.0.0.5"], ["fe80::1%eth0"]]
)
def test_a_name_that_means_an_address_inside_is_not_connected_to(
    meaning: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(addresses.socket, "getaddrinfo", lambda *_, **__: [(0, 0, 0, "", (one, 80)) for one in meaning])
    monkeypatch.setattr(addresses.socket, "create_connection", lambda *_: pytest.fail("it was connected to"))
    outcome = send("http://ci.example.org/", {}, b"{}")
    assert outcome.status is None
    assert "not public" in str(outcome.problem)


def test_a_name_is_resolved_once(there: Receiver, monkeypatch: pytest.MonkeyPatch) -> None:
    """What it means at a second question does not count: the connection goes to the address that was checked."""
    meanings = [["127.0.0.1"], ["10.0.0.5"]]
    resolved: list[str] = []

    def means(host: str, *_: object, **__: object) -> list[Any]:
        if host[0].isdigit():  # the connection to an address that is known
            return [(2, 1, 6, "", (host, int(there.url.rpartition(":")[2])))]
        resolved.append(host)
        return [(2, 1, 6, "", (one, 80)) for one in meanings.pop(0)]

    monkeypatch.setattr(addresses.socket, "getaddrinfo", means)
    url = there.url.replace("127.0.0.1", "ci.example.org")
    assert send(url, {}, b"{}", NETWORKS) == Outcome(204)
    assert resolved == ["ci.example.org"]
    assert there.messages[0].headers["host"] == url.removeprefix("http://")


def test_an_answer_has_bounds_of_time_and_size(there: Receiver) -> None:
    def drip(handler: BaseHTTPRequestHandler) -> None:
        for _ in range(100):
            handler.wfile.write(b"X")
            time.sleep(0.05)

    def flood(handler: BaseHTTPRequestHandler) -> None:
        handler.wfile.write(b"HTTP/1.1 200 OK\r\n\r\n")
        for _ in range(1000):
            handler.wfile.write(b"x" * ANSWER_BYTES)

    def babble(handler: BaseHTTPRequestHandler) -> None:
        handler.wfile.write(b"no HTTP at all\r\n\r\n")

    start = time.monotonic()
    for answer, status, said in ((drip, None, "within 0.3 seconds"), (flood, 200, "None"), (babble, None, "not HTTP")):
        there.answer = answer
        outcome = send(there.url, {}, b"{}", NETWORKS, seconds=0.3)
        assert outcome.status == status
        assert said in str(outcome.problem)
    assert time.monotonic() - start < 20.0


def test_a_receiver_without_a_right_certificate_is_not_told(there: Receiver) -> None:
    outcome = send(there.url.replace("http:", "https:"), {}, b"{}", NETWORKS, seconds=2.0)
    assert (outcome.status, there.messages) == (None, [])


def test_an_address_inside_is_refused_at_once_and_there_are_only_so_many(
    database: Database, monkeypatch: pytest.MonkeyPatch
) -> None:
    strict = Webhooks(database)
    for url in ("http://127.0.0.1:8035/v1/keys", "http://[::1]/", "http://169.254.169.254/latest"):
        with pytest.raises(Problem, match="not public"):
            _hear(strict, url)
    for number in range(LIMITS.webhooks):
        _hear(strict, f"https://ci.example.org/{number}")
    with pytest.raises(Problem, match="as many as there may be") as problem:
        _hear(strict, "https://ci.example.org/")
    assert problem.value.code is ExitCode.LIMIT
    with pytest.raises(Problem, match="at least one event"):
        strict.create("https://ci.example.org/", (), "key_000000000000")


def test_the_api_shows_the_secret_once(tmp_path: Path) -> None:
    api = Api(tmp_path)
    made = api.post("/v1/webhooks", "admin", json={"url": "https://ci.example.org/x", "events": ["job.failed"]})
    assert (made.status_code, made.headers["cache-control"]) == (201, "no-store")
    webhook, secret = made.json()["webhook"], made.json()["secret"]
    assert secret.startswith("whsec_")
    path = f"/v1/webhooks/{webhook['id']}"
    assert api.get("/v1/webhooks", "admin").json()["items"] == [webhook]
    tests = [api.post(f"{path}/test", "admin") for _ in range(3)]
    assert {test.status_code for test in tests} == {202}
    sent = [test.json() for test in tests]
    first = api.get(f"{path}/deliveries?limit=2", "admin")
    rest = api.get(first.links["next"]["url"], "admin")
    items = [*first.json()["items"], *rest.json()["items"]]
    assert sorted(items, key=str) == sorted(sent, key=str)
    for answer in (api.get("/v1/webhooks", "admin"), first, rest, *tests):
        assert secret not in answer.text
    everything = api.post("/v1/webhooks", "admin", json={"url": "https://ci.example.org/"}).json()["webhook"]
    assert everything["events"] == list(WEBHOOK_EVENTS)
    assert api.request("DELETE", path).status_code == 204
    for method, place in (("DELETE", path), ("POST", f"{path}/test"), ("GET", f"{path}/deliveries")):
        assert api.request(method, place).status_code == 404
    for url in ("http://localhost:1 2/", "ftp://ci.example.org/", "http://10.0.0.1/", "x" * 3000):
        assert api.post("/v1/webhooks", "admin", json={"url": url}).status_code == 422
    assert api.post("/v1/webhooks", "admin", json={"url": "https://a.example/", "events": ["x"]}).status_code == 422


def test_old_deliveries_are_removed(tmp_path: Path) -> None:
    api = Api(tmp_path)
    service = api.service
    webhook_id, _ = _hear(service.webhooks, "https://ci.example.org/")
    for _ in range(2):
        service.webhooks.test(webhook_id)
    (old,) = queue.claim(service.database)
    assert queue.settle(service.database, old, Outcome(204), None)
    sweep(service.database, service.storage, service.settings, time.time() + 40 * 86400.0)
    assert _states(service.webhooks, webhook_id) == ["waiting"]
