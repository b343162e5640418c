from __future__ import annotations

import time
from pathlib import Path

import pytest
from fastapi import Request
from sqlalchemy.exc import OperationalError
from support.api import Api

from services.api.ledger import Ledger
from services.api.rate import SETTLE_PART, Buckets
from services.api.security import address_of
from services.database import Database, open_database

SLOW = 1e-4
"""Tokens a second: none comes back while a test runs."""


class Clock:
    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now


def _taken(buckets: Buckets, times: int, name: str = "a") -> int:
    return sum(buckets.take(name).allowed for _ in range(times))


def test_a_bucket_fills_again() -> None:
    clock = Clock()
    buckets = Buckets(2.0, 4, clock=clock)
    assert _taken(buckets, 10) == 4
    assert _taken(buckets, 10, "b") == 4
    clock.now += 1.0
    assert _taken(buckets, 10) == 2
    refused = buckets.take("a")
    assert (refused.left, refused.wait, refused.full) == (0, 0.5, 2.0)
    clock.now += 100.0
    assert _taken(buckets, 10) == 4


@pytest.fixture
def database(database_url: str) -> Database:
    return open_database(database_url)


def test_processes_share_what_a_bucket_holds(database: Database) -> None:
    """Each has a copy of its own, and could empty it by itself."""
    burst, processes = 80, [Buckets(SLOW, 80, Ledger(database, "key")) for _ in range(4)]
    taken = sum(bucket.take("a").allowed for _ in range(burst) for bucket in processes)
    assert burst <= taken <= burst + len(processes) * burst // SETTLE_PART


def test_what_was_overdrawn_is_missing_afterwards(database: Database) -> None:
    one, other = (Buckets(SLOW, 16, Ledger(database, "key")) for _ in range(2))
    taken = sum(bucket.take("a").allowed for _ in range(40) for bucket in (one, other))
    for bucket in (one, other):
        bucket.settle()
    assert Ledger(database, "key").level("a", SLOW, 16) == pytest.approx(16 - taken, abs=0.1)
    assert one.take("a").left == 0


def test_what_was_taken_survives_a_restart(database: Database) -> None:
    before = Buckets(SLOW, 8, Ledger(database, "address"))
    assert _taken(before, 20) == 8
    before.settle()
    assert _taken(Buckets(SLOW, 8, Ledger(database, "address")), 20) == 0
    assert _taken(Buckets(SLOW, 8, Ledger(database, "key")), 20) == 8


def test_full_buckets_are_forgotten(database: Database, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("services.api.ledger.FORGET_SECONDS", -1.0)
    slow, fast = Ledger(database, "key"), Ledger(database, "address")
    slow.settle({"a": 3.0}, SLOW, 8)
    fast.settle({"a": 3.0}, 1e9, 8)
    time.sleep(0.05)
    fast.settle({"b": -8.0}, 1e9, 8)  # which begins full
    assert slow.level("a", SLOW, 8) == pytest.approx(5.0, abs=0.1)
    with database.read() as connection:
        assert connection.exec_driver_sql("select name, kind from allowances").all() == [("a", "key")]


def test_without_the_database_each_process_has_its_own(database: Database, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise OperationalError("", None, Exception("away"))

    monkeypatch.setattr(Ledger, "level", fail)
    monkeypatch.setattr(Ledger, "settle", fail)
    assert _taken(Buckets(SLOW, 8, Ledger(database, "key")), 20) == 8


@pytest.mark.parametrize(
    ("address", "counted"),
    [
        ("203.0.113.7", "203.0.113.7"),
        ("::ffff:203.0.113.7", "203.0.113.7"),
        ("2001:db8:1:2:3:4:5:6", "2001:db8:1:2::/64"),
        ("2001:db8:1:2:aaaa::1", "2001:db8:1:2::/64"),
        ("somebody" * 20, ("somebody" * 20)[:64]),
    ],
)
def test_an_address_stands_for_one_user(address: str, counted: str) -> None:
    assert address_of(Request({"type": "http", "client": (address, 1), "headers": []})) == counted


def test_two_servers_on_one_database_hold_a_key_to_one_rate(database_url: str, tmp_path: Path) -> None:
    one, other = (Api(tmp_path / name, database_url, rate=SLOW, burst=40) for name in ("one", "other"))
    other.secrets = one.secrets
    statuses = [api.get("/v1/jobs").status_code for _ in range(60) for api in (one, other)]
    assert 40 <= statuses.count(200) <= 40 + 2 * 40 // SETTLE_PART
    assert statuses[-1] == 429
    # A quarter of the burst may be guessed at, over both.
    guess = {"Authorization": f"Bearer dia_{'0' * 12}_{'A' * 43}"}
    statuses = [api.get("/v1/jobs", None, headers=guess).status_code for _ in range(20) for api in (one, other)]
    assert 10 <= statuses.count(401) <= 10 + 2 * (10 // SETTLE_PART + 1)
    assert statuses[-1] == 429
