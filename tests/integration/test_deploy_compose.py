"""docker-compose.yml: hardened, complete, and understood by docker compose where there is one."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from pathlib import Path

import pytest
from support.deploy import CONTAINERS, ROOT, VARIABLE, compose, own_services, services

from schemas.service import SCOPES
from services.settings import Settings
from stages.tasks import ROLES

SECRET = re.compile(r"PASSWORD|SECRET|_KEY|DATABASE$")
ONE_SHOT = "buckets"


@pytest.mark.parametrize("name", sorted(services()))
def test_a_service_has_no_rights_and_a_read_only_root(name: str) -> None:
    service = services()[name]
    assert service["read_only"] is True
    assert service["cap_drop"] == ["ALL"]
    assert service["security_opt"] == ["no-new-privileges:true"]
    assert "privileged" not in service
    assert set(service.get("cap_add", [])) <= ({"CHOWN", "DAC_OVERRIDE"} if name == ONE_SHOT else set())


@pytest.mark.parametrize("name", sorted(set(services()) - {ONE_SHOT}))
def test_a_service_comes_back_and_tells_how_it_is(name: str) -> None:
    service = services()[name]
    assert service["restart"] == "always"
    assert service["healthcheck"]["test"][0] == "CMD"


def test_every_role_is_served() -> None:
    served = {service["command"][-1] for service in own_services().values() if service["command"][1] == "worker"}
    assert served == set(ROLES)


@pytest.mark.parametrize("name", sorted(own_services()))
def test_an_own_service_waits_for_what_it_needs(name: str) -> None:
    needs = own_services()[name]["depends_on"]
    assert {needed: rule["condition"] for needed, rule in needs.items()} == {
        "postgres": "service_healthy",
        "objects": "service_healthy",
    }


@pytest.mark.parametrize("name", sorted(own_services()))
def test_the_image_and_compose_agree(name: str) -> None:
    service = own_services()[name]
    if "build" not in service:  # the jobs run in the API's image, with another command
        return
    stage = _stage(service["build"]["target"])
    assert service["image"].partition(":")[0] == f"diaphane/{service['build']['target']}"
    assert service["healthcheck"]["test"][1:] == re.findall(r'"([^"]+)"', stage.partition("HEALTHCHECK")[2])
    run = re.findall(r'"([^"]+)"', re.findall(r"^CMD (.*)$", stage, re.MULTILINE)[-1])
    assert service["command"][: len(run)] == run


def test_ports_are_published_on_loopback_only() -> None:
    published = {name: service["ports"] for name, service in services().items() if "ports" in service}
    assert set(published) == {"api"}
    assert all(port.startswith("127.0.0.1:") for port in published["api"])


def test_workers_that_open_scenes_reach_the_database_and_the_store_only() -> None:
    """Webhooks are delivered by who conducts jobs: it reaches others, and nobody reaches it."""
    assert compose()["networks"]["data"]["internal"] is True
    reach = {name: service["networks"] for name, service in own_services().items()}
    assert {name for name, networks in reach.items() if networks != ["data"]} == {"api", "jobs"}
    assert reach["jobs"] == ["data", "edge"]


def test_who_takes_webhooks_and_who_delivers_them_agree_on_where_they_may_lead() -> None:
    names = {n for n, s in own_services().items() if "DIAPHANE_WEBHOOK_NETWORKS" in s["environment"]}
    assert names == {"api", "jobs"}


def test_only_who_publishes_has_the_signing_key() -> None:
    assert {n for n, s in own_services().items() if "DIAPHANE_SIGNING_KEY" in s["environment"]} == {"api", "jobs"}


def test_secrets_have_no_default() -> None:
    for name, service in services().items():
        for variable, value in service.get("environment", {}).items():
            if not SECRET.search(variable):
                continue
            used = list(VARIABLE.finditer(value))
            assert used, f"{name}: {variable} is a literal"
            assert all(match["rule"] == ":?" for match in used), f"{name}: {variable} has a default"


def test_the_example_names_every_variable_and_holds_no_secret() -> None:
    example = dict(
        line.split("=", 1)
        for line in (ROOT / ".env.example").read_text(encoding="utf-8").splitlines()
        if line and not line.startswith("#")
    )
    used = {match["name"] for match in VARIABLE.finditer((ROOT / "docker-compose.yml").read_text(encoding="utf-8"))}
    assert used - {"DIAPHANE_VERSION"} == set(example)
    assert not any(value for variable, value in example.items() if SECRET.search(variable))


@pytest.mark.parametrize("name", sorted(own_services()))
def test_what_is_configured_is_a_setting(name: str) -> None:
    given = {key for key in own_services()[name]["environment"] if key.startswith("DIAPHANE_")}
    assert given <= {f"DIAPHANE_{field.upper()}" for field in Settings.model_fields}


def test_a_worker_may_finish_what_it_does() -> None:
    for service in own_services().values():
        grace = int(service["stop_grace_period"].removesuffix("s"))
        assert grace > Settings.model_fields["drain_seconds"].default


def test_scopes_in_the_instructions_exist() -> None:
    text = (ROOT / "deploy" / "README.md").read_text(encoding="utf-8")
    named = set(re.findall(r"--scope (\w+)", text))
    assert named
    assert named <= set(SCOPES)


def test_docker_compose_understands_it(tmp_path: Path) -> None:
    command = _docker_compose()
    if command is None:
        pytest.skip("docker compose is not installed")
    filled = tmp_path / "env"
    example = (ROOT / ".env.example").read_text(encoding="utf-8")
    filled.write_text(re.sub(r"^([A-Z_]+)=$", r"\1=x", example, flags=re.MULTILINE), encoding="utf-8")
    call = [*command, "--file", str(ROOT / "docker-compose.yml"), "--profile", "gpu"]
    subprocess.run([*call, "--env-file", str(filled), "config", "--quiet"], check=True, env=_bare())
    empty = subprocess.run(
        [*call, "--env-file", str(ROOT / ".env.example"), "config"], capture_output=True, text=True, env=_bare()
    )
    assert empty.returncode != 0
    assert "see .env.example" in empty.stderr


def _bare() -> dict[str, str]:
    return {name: os.environ[name] for name in ("PATH", "HOME") if name in os.environ}


def _docker_compose() -> list[str] | None:
    for command in (["docker", "compose"], ["docker-compose"]):
        if shutil.which(command[0]) and subprocess.run([*command, "version"], capture_output=True).returncode == 0:
            return command
    return None


def _stage(target: str) -> str:
    """The Dockerfile's text for a target, after that of the stages it begins with."""
    stages = {}
    for text in re.split(r"^(?=FROM )", (CONTAINERS / "Dockerfile").read_text(encoding="utf-8"), flags=re.MULTILINE):
        if match := re.match(r"FROM (\S+) AS (\S+)\n", text):
            stages[match[2]] = stages.get(match[1], "") + text
    return stages[target]
