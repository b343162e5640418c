from __future__ import annotations

import uuid
from collections.abc import Iterator
from pathlib import Path

import psycopg
import pytest
from support.postgres import Postgres
from support.workers import Fleet

from services.database import open_database
from services.engine import system


@pytest.fixture(scope="session")
def made(postgres: Postgres) -> str:
    """URL of a database with all tables, which others are copied from: making them takes seconds."""
    url = postgres.new_database()
    database = open_database(url)
    system.migrate(database)
    database.close()
    return url


@pytest.fixture(params=["sqlite", "postgresql"])
def database_url(request: pytest.FixtureRequest, tmp_path: Path) -> str:
    if request.param == "sqlite":
        return f"sqlite:///{tmp_path / 'test.sqlite'}"
    server, _, template = request.getfixturevalue("made").rpartition("/")
    name = f"c{uuid.uuid4().hex[:12]}"
    with psycopg.connect(f"{server}/postgres", autocommit=True) as connection:
        connection.execute(f"create database {name} template {template}")
    return f"{server}/{name}"


@pytest.fixture
def fleet(tmp_path: Path, database_url: str) -> Iterator[Fleet]:
    """A service without workers."""
    with Fleet(tmp_path, database_url) as found:
        yield found
