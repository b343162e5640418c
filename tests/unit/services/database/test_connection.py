from __future__ import annotations

import threading
from pathlib import Path

import pytest
import sqlalchemy as sa
from support.postgres import Postgres

from schemas.problem import Problem
from services.database import Database, open_database, tables


@pytest.fixture(params=["sqlite", "postgresql"])
def empty_url(request: pytest.FixtureRequest, tmp_path: Path) -> str:
    """URL of a database without tables."""
    if request.param == "sqlite":
        return f"sqlite:///{tmp_path / 'test.sqlite'}"
    server: Postgres = request.getfixturevalue("postgres")
    return server.empty_database()


def _count(database: Database) -> int:
    with database.read() as connection:
        return int(connection.scalar(sa.select(sa.func.count()).select_from(tables.aliases)) or 0)


def _write_and_fail(database: Database) -> None:
    with database.write() as connection:
        connection.execute(tables.aliases.insert().values(name="a", alias="champion", version="1.0.0"))
        raise KeyError


def test_a_transaction_is_kept_whole_or_not_at_all(database_url: str) -> None:
    database = open_database(database_url)
    with pytest.raises(KeyError):
        _write_and_fail(database)
    assert _count(database) == 0
    with database.write() as connection:
        connection.execute(tables.aliases.insert().values(name="a", alias="champion", version="1.0.0"))
    assert _count(database) == 1


def test_tables_are_made_once_by_whoever_comes_first(empty_url: str) -> None:
    opened: list[Database] = []
    threads = [threading.Thread(target=lambda: opened.append(open_database(empty_url))) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert [_count(database) for database in opened] == [0] * len(threads)
    with opened[0].read() as connection:
        assert connection.scalars(sa.select(tables.meta.c.value)).all() == [tables.SCHEMA]


def test_opening_again_changes_nothing_and_other_tables_are_refused(database_url: str) -> None:
    database = open_database(database_url)
    open_database(database_url).close()
    with database.write() as connection:
        connection.execute(tables.meta.update().values(value="0"))
    with pytest.raises(Problem, match="tables of version 0"):
        open_database(database_url)


def test_writers_wait_for_each_other(database_url: str) -> None:
    database = open_database(database_url)
    with database.write() as connection:
        connection.execute(tables.meta.insert().values(name="count", value="0"))

    def add() -> None:
        for _ in range(25):

            def body(connection: sa.Connection) -> None:
                locked = sa.select(tables.meta.c.value).where(tables.meta.c.name == "count").with_for_update()
                value = int(connection.scalar(locked) or 0)
                connection.execute(
                    tables.meta.update().where(tables.meta.c.name == "count").values(value=str(value + 1))
                )

            database.retry(body)

    threads = [threading.Thread(target=add) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    with database.read() as connection:
        assert connection.scalar(sa.select(tables.meta.c.value).where(tables.meta.c.name == "count")) == "100"


def test_an_unknown_scheme_says_what_to_set() -> None:
    with pytest.raises(Problem, match="DIAPHANE_DATABASE"):
        Database("mysql://somewhere/else")


def test_a_server_that_cannot_be_reached_is_named_without_its_password(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("services.database.connection.START_PATIENCE_SECONDS", 0.3)
    with pytest.raises(Problem, match=r"127\.0\.0\.1 cannot be used") as caught:
        open_database("postgresql://somebody:hidden-word@127.0.0.1:1/none")
    assert "hidden-word" not in str(caught.value)
    assert "DIAPHANE_DATABASE" in caught.value.remedy


def test_a_new_folder_is_its_owners_alone(tmp_path: Path) -> None:
    open_database(f"sqlite:///{tmp_path / 'state' / 'x.sqlite'}").close()
    assert (tmp_path / "state").stat().st_mode & 0o077 == 0
