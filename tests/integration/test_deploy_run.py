"""What docker-compose.yml starts, as plain processes with a real PostgreSQL and S3 server: healthy, and good for a job.

Each process can import only what its image holds.
"""

from __future__ import annotations

import json
import socket
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from support.deploy import own_services
from support.kernels import warm
from support.postgres import Postgres
from support.processes import Service
from support.s3 import S3Server
from support.solids import SPHERE_AND_CUBE

from stages.catalogue import STAGES

SAME_AS_RENDER = "render-gpu"
SERVICES = sorted(set(own_services()) - {SAME_AS_RENDER})
VARIABLES = {
    "POSTGRES_PASSWORD": "pw",
    "OBJECTS_ACCESS_KEY": "test",
    "OBJECTS_SECRET_KEY": "test",
    "DIAPHANE_SIGNING_KEY": "AAECAwQFBgcICQoLDA0ODxAREhMUFRYXGBkaGxwdHh8=",
}


@dataclass
class Running:
    services: dict[str, Service]
    refused: Service
    key: str

    def cli(self, *words: str) -> Any:
        """A command of a user, who has everything installed and only the key; its JSON."""
        api = self.services["api"]
        done = api.run("diaphane", *words, "--json", DIAPHANE_KEY=self.key, BLOCKED_IMPORTS="", DIAPHANE_DATABASE="")
        logs = "\n".join(f"--- {name}\n{service.log[-3000:]}" for name, service in self.services.items())
        assert done.returncode == 0, f"{words}: {done.stderr}\n{logs}"
        return json.loads(done.stdout)


@pytest.fixture(scope="module")
def running(postgres: Postgres, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Running]:
    folder, objects, port = tmp_path_factory.mktemp("deployed"), S3Server(), _free_port()
    instead = {
        **objects.environment,
        "DIAPHANE_DATABASE": postgres.empty_database(),
        "DIAPHANE_STORE": f"s3://{objects.new_bucket()}",
        "DIAPHANE_URL": f"http://127.0.0.1:{port}",
    }
    services = {name: Service(name, folder, VARIABLES, instead) for name in SERVICES}
    try:
        api = services["api"]
        refused = api.run(*[word.replace("8035", str(port)) for word in own_services()["api"]["command"]])
        made = api.run("diaphane", "keys", "create", "admin", "--scope", "admin", "--local")
        assert made.returncode == 0, made.stderr
        key = made.stdout.strip()
        owner = f"key_{key.split('_')[1]}"
        warm(folder / name / "work" / "kernels" / owner for name in services)
        for service in services.values():
            service.start(port)
        yield Running(services, refused, key)  # type: ignore[arg-type]
    finally:
        for service in services.values():
            service.kill()
        objects.stop()


def test_without_a_key_the_api_does_not_listen_beyond_loopback(running: Running) -> None:
    assert running.refused.returncode not in (0, 130)
    assert "key" in running.refused.stderr


@pytest.mark.parametrize("name", SERVICES)
def test_a_service_becomes_healthy_by_its_own_check(running: Running, name: str) -> None:
    running.services[name].wait_until_healthy(90.0)


def test_an_unknown_role_and_a_silent_host_are_not_healthy(running: Running, tmp_path: Path) -> None:
    api = running.services["api"]
    api.wait_until_healthy(90.0)
    assert api.run("diaphane", "health", "--role", "cook").returncode == 2
    fresh = f"sqlite:///{tmp_path / 'nobody.sqlite'}"
    assert api.run("diaphane", "health", "--role", "render", DIAPHANE_DATABASE=fresh).returncode != 0
    gone = "postgresql://nobody@127.0.0.1:9/none"
    assert api.run("diaphane", "health", "--role", "render", DIAPHANE_DATABASE=gone).returncode == 6
    assert api.run("diaphane", "health", "--role", "render", "--live", DIAPHANE_DATABASE=gone).returncode == 0
    assert api.run("diaphane", "health", "--url", "http://127.0.0.1:9").returncode == 1


def test_together_they_build_from_upload_to_published_version(running: Running, tmp_path: Path) -> None:
    for service in running.services.values():
        service.wait_until_healthy(90.0)
    scenes = []
    for name, radius in (("near.usda", 1.0), ("far.usda", 1.5)):
        (tmp_path / name).write_text(SPHERE_AND_CUBE.format(radius=radius), encoding="utf-8")
        scenes.append(str(tmp_path / name))
    options = ["--name", "tiny", "--size", "64x48", "--budgets", "1", "--alpha", "0.5", "--steps", "20"]
    options += ["--views-per-scene", "1", "--weights", "flip"]  # which needs FLIP where labels are made
    submitted = running.cli("jobs", "submit", "build", "--scene", *scenes[:1], "--holdout", scenes[1], *options)
    job = _ended(running, submitted["id"])
    tasks = running.cli("jobs", "tasks", job["id"])["tasks"]
    assert job["state"] == "succeeded", [job["problem"], *(task["problem"] for task in tasks)]
    by_role: dict[str, set[str]] = {}
    for task in tasks:
        by_role.setdefault(STAGES[task["stage"]].role, set()).add(task["executor"])
    assert set(by_role) == {"render", "label", "train"}
    assert all(len(executors) == 1 for executors in by_role.values())
    shown = running.cli("models", "show", "tiny")
    assert "1.0.0" in json.dumps(shown)


def test_services_that_are_told_to_stop_do_and_are_not_healthy_any_more(running: Running) -> None:
    for service in running.services.values():
        service.wait_until_healthy(90.0)
    for service in running.services.values():
        service.tell_to_stop()
    for name, service in running.services.items():
        assert service.wait(60.0) == 0, name
        assert "Traceback" not in service.log, name
        assert service.check().returncode != 0, name


def _ended(running: Running, job_id: str) -> dict[str, Any]:
    running.services["api"].run("diaphane", "jobs", "watch", job_id, DIAPHANE_KEY=running.key)  # whatever its end
    shown: dict[str, Any] = running.cli("jobs", "show", job_id)
    return shown


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])
