from __future__ import annotations

import hmac
import time

import pytest
import sqlalchemy as sa

from schemas.problem import Problem
from services.database import open_database, tables
from services.keys import Keys, allows


def test_a_secret_opens_and_is_stored_nowhere(database_url: str) -> None:
    database = open_database(database_url)
    keys = Keys(database)
    assert not keys.any()
    record, secret = keys.create("ci", ["submit"])
    found = keys.authenticate(secret).key
    assert found is not None
    assert found.id == record.id
    assert keys.any()
    with database.read() as connection:
        row = dict(connection.execute(sa.select(tables.keys)).mappings().one())
    assert secret.split("_", 2)[2] not in str(row)


@pytest.mark.parametrize("change", ["", "dia_", "x", "dia_000000000000_" + "a" * 43, "\udcff", "a\0b"])
def test_anything_else_does_not_open(change: str, database_url: str) -> None:
    keys = Keys(open_database(database_url))
    keys.create("ci", ["submit"])
    assert keys.authenticate(change).key is None


def test_the_secret_of_one_key_does_not_open_another(database_url: str) -> None:
    keys = Keys(open_database(database_url))
    (_, one), (_, other) = keys.create("one", ["read"]), keys.create("other", ["admin"])
    assert keys.authenticate(f"{other[:17]}{one[17:]}").key is None


def test_hashes_are_compared_in_constant_time_also_for_unknown_ids(
    database_url: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    keys = Keys(open_database(database_url))
    _, secret = keys.create("ci", ["read"])
    compared = []
    compare = hmac.compare_digest
    monkeypatch.setattr(hmac, "compare_digest", lambda a, b: compared.append((a, b)) or compare(a, b))
    keys.authenticate(secret)
    keys.authenticate("dia_000000000000_" + "a" * 43)
    assert len(compared) == 2


def test_a_revoked_key_and_an_expired_one_are_refused(database_url: str, monkeypatch: pytest.MonkeyPatch) -> None:
    keys = Keys(open_database(database_url))
    record, secret = keys.create("ci", ["read"])
    _, short = keys.create("short", ["read"], expires=time.time() + 60.0)
    assert keys.authenticate(short).key is not None
    first = keys.revoke(record.id)
    assert keys.authenticate(secret).key is None
    assert keys.revoke(record.id).revoked == first.revoked
    now = time.time()
    monkeypatch.setattr(time, "time", lambda: now + 61.0)
    assert keys.authenticate(short).key is None
    assert not keys.any()


def test_a_use_is_noted_at_most_once_a_minute(database_url: str, monkeypatch: pytest.MonkeyPatch) -> None:
    keys = Keys(open_database(database_url))
    _, secret = keys.create("ci", ["read"])
    now = time.time()
    used = []
    for later in (0.0, 30.0, 61.0):
        monkeypatch.setattr(time, "time", lambda later=later: now + later)
        keys.authenticate(secret)
        used.append(keys.list()[0].last_used)
    assert used[0] is not None
    assert used[0] == used[1] != used[2]


def test_nonsense_is_refused_with_what_to_do(database_url: str) -> None:
    keys = Keys(open_database(database_url))
    with pytest.raises(Problem, match="Choose among read, submit, publish, admin"):
        keys.create("ci", [])
    with pytest.raises(Problem, match="a time in the future"):
        keys.create("ci", ["read"], expires=1.0)
    with pytest.raises(Problem, match="no key key_000000000000"):
        keys.revoke("key_000000000000")


@pytest.mark.parametrize(
    ("held", "scopes"),
    [("read", "r"), ("submit", "rs"), ("publish", "rp"), ("admin", "rspa")],
)
def test_scopes_contain_others(held: str, scopes: str, database_url: str) -> None:
    record, _ = Keys(open_database(database_url)).create("ci", [held])  # type: ignore[list-item]
    assert "".join(scope[0] for scope in ("read", "submit", "publish", "admin") if allows(record, scope)) == scopes  # type: ignore[arg-type]
