"""The Kubernetes manifests: valid by the API's schemas, hardened, in step with compose and with the engine."""

from __future__ import annotations

import re
import shutil
import subprocess
from typing import Any

import kubernetes_validate
import psycopg
import pytest
import yaml
from pydantic import BaseModel, ConfigDict, Field
from support.deploy import MANIFESTS, deployments, manifests, own_services
from support.postgres import Postgres

from services.engine import system
from services.settings import Settings
from stages.tasks import ROLES

BASE = list(manifests("base"))
KEDA = list(manifests("keda"))
VERSIONS = ("1.31", "1.34")
"""Of Kubernetes: the oldest and the newest that the manifests are checked against."""


def label(document: dict[str, Any]) -> str:
    return f"{document['kind']}-{document['metadata']['name']}"


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("document", BASE, ids=label)
def test_an_object_is_valid(document: dict[str, Any], version: str) -> None:
    kubernetes_validate.validate(document, version, strict=True)


def test_the_validation_finds_a_misspelt_field() -> None:
    document = next(found for found in BASE if found["kind"] == "Deployment")
    wrong = {**document, "spec": {**document["spec"], "replica": 2}}
    with pytest.raises(kubernetes_validate.ValidationError):
        kubernetes_validate.validate(wrong, VERSIONS[0], strict=True)


def test_the_example_of_the_secrets_is_valid_and_holds_none() -> None:
    text = (MANIFESTS / "secret.example.yaml").read_text(encoding="utf-8")
    documents = list(yaml.safe_load_all(text))
    for document in documents:
        kubernetes_validate.validate(document, VERSIONS[0], strict=True)
        for value in document["stringData"].values():
            assert value == "" or "PASSWORD" in value
    named = {document["metadata"]["name"] for document in documents}
    assert {"diaphane", "diaphane-signing"} == _secrets_used()
    assert named == {"diaphane", "diaphane-signing", "diaphane-queue"}


@pytest.mark.parametrize("name", sorted(deployments()))
def test_a_pod_has_no_rights(name: str) -> None:
    pod = deployments()[name]["spec"]["template"]["spec"]
    assert pod["automountServiceAccountToken"] is False
    assert pod["securityContext"]["runAsNonRoot"] is True
    assert pod["securityContext"]["runAsUser"] == 10001
    assert pod["securityContext"]["seccompProfile"] == {"type": "RuntimeDefault"}
    (container,) = pod["containers"]
    assert container["securityContext"] == {
        "allowPrivilegeEscalation": False,
        "readOnlyRootFilesystem": True,
        "capabilities": {"drop": ["ALL"]},
    }
    assert {mount["mountPath"] for mount in container["volumeMounts"]} == {"/var/lib/diaphane", "/tmp"}


@pytest.mark.parametrize("name", sorted(deployments()))
def test_a_container_is_probed_and_bounded(name: str) -> None:
    (container,) = deployments()[name]["spec"]["template"]["spec"]["containers"]
    assert {"startupProbe", "livenessProbe", "readinessProbe"} <= set(container)
    assert {"cpu", "memory"} <= set(container["resources"]["requests"])
    assert "memory" in container["resources"]["limits"]


@pytest.mark.parametrize("name", sorted(deployments()))
def test_a_container_runs_what_compose_runs(name: str) -> None:
    (container,) = deployments()[name]["spec"]["template"]["spec"]["containers"]
    service = own_services()[name]
    assert container["args"] == service["command"]
    assert container["image"] == service["image"].partition(":")[0]
    if name != "api":
        assert container["readinessProbe"]["exec"]["command"] == service["healthcheck"]["test"][1:]
        assert container["livenessProbe"]["exec"]["command"] == [*service["healthcheck"]["test"][1:], "--live"]


@pytest.mark.parametrize("name", sorted(deployments()))
def test_a_worker_may_finish_what_it_does(name: str) -> None:
    pod = deployments()[name]["spec"]["template"]["spec"]
    assert pod["terminationGracePeriodSeconds"] > float(_environment(name)["DIAPHANE_DRAIN_SECONDS"])


def test_what_is_configured_is_a_setting() -> None:
    known = {f"DIAPHANE_{field.upper()}" for field in Settings.model_fields}
    for name in deployments():
        assert {key for key in _environment(name) if key.startswith("DIAPHANE_")} <= known


@pytest.mark.parametrize("document", [found for found in BASE if "selector" in found.get("spec", {})], ids=label)
def test_a_selector_finds_pods(document: dict[str, Any]) -> None:
    selector = document["spec"]["selector"]
    wanted = set(selector.get("matchLabels", selector).items())
    found = [name for name, made in deployments().items() if wanted <= set(_labels(made).items())]
    assert found == [document["metadata"]["name"]]


def test_every_deployment_outlives_a_drained_node() -> None:
    budgets = {found["metadata"]["name"] for found in BASE if found["kind"] == "PodDisruptionBudget"}
    assert budgets == set(deployments())


@pytest.mark.parametrize("folder", ["base", "gpu", "keda"])
def test_kustomize_builds_it(folder: str) -> None:
    kubectl = shutil.which("kubectl")
    if kubectl is None:
        pytest.skip("kubectl is not installed")
    built = subprocess.run([kubectl, "kustomize", str(MANIFESTS / folder)], capture_output=True, text=True)
    assert built.returncode == 0, built.stderr
    objects = list(yaml.safe_load_all(built.stdout))
    assert all(found["metadata"].get("namespace", "diaphane") == "diaphane" for found in objects)
    images = set(re.findall(r"image: (\S+)", built.stdout))
    assert all(":" in image for image in images), "an image without a tag"
    assert (folder == "gpu") == any(image.startswith("diaphane/render-gpu:") for image in images)


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid")


class _Metadata(_Strict):
    query: str
    targetQueryValue: str = Field(pattern=r"^[1-9][0-9]*$")
    activationTargetQueryValue: str = Field(pattern=r"^[0-9]+$")


class _Trigger(_Strict):
    type: str = Field(pattern="^postgresql$")
    metadata: _Metadata
    authenticationRef: dict[str, str]


class _ScaledObject(_Strict):
    """The fields of KEDA's `ScaledObject` that are used here, as keda.sh/v1alpha1 has them."""

    scaleTargetRef: dict[str, str]
    pollingInterval: int = Field(ge=1)
    cooldownPeriod: int = Field(ge=0)
    minReplicaCount: int = Field(ge=0)
    maxReplicaCount: int = Field(ge=1)
    fallback: dict[str, int]
    advanced: dict[str, Any]
    triggers: list[_Trigger] = Field(min_length=1, max_length=1)


def _scaled() -> dict[str, _ScaledObject]:
    found = {}
    for document in KEDA:
        assert document["apiVersion"] == "keda.sh/v1alpha1"
        if document["kind"] == "ScaledObject":
            found[document["metadata"]["name"]] = _ScaledObject.model_validate(document["spec"])
    return found


def test_every_role_that_does_tasks_is_scaled_by_its_queue() -> None:
    scaled = _scaled()
    assert set(scaled) == set(ROLES) - {"jobs"}
    (authentication,) = (found for found in KEDA if found["kind"] == "TriggerAuthentication")
    assert [ref["parameter"] for ref in authentication["spec"]["secretTargetRef"]] == ["connection"]
    for name, found in scaled.items():
        assert found.scaleTargetRef == {"name": name}
        assert found.triggers[0].authenticationRef == {"name": authentication["metadata"]["name"]}
        behaviour = found.advanced["horizontalPodAutoscalerConfig"]["behavior"]
        autoscaler = {
            "apiVersion": "autoscaling/v2",
            "kind": "HorizontalPodAutoscaler",
            "metadata": {"name": name},
            "spec": {"scaleTargetRef": {"kind": "Deployment", "name": name}, "maxReplicas": 1, "behavior": behaviour},
        }
        kubernetes_validate.validate(autoscaler, VERSIONS[0], strict=True)


def test_the_queues_are_counted_by_a_user_who_can_do_nothing_else(postgres: Postgres) -> None:
    url = postgres.empty_database()
    grants = _block_of_the_readme("create role diaphane_queue")
    from services.database import open_database

    database = open_database(url)
    try:
        system.migrate(database)
        client = system.open_client(database)
        with database.write() as connection:
            for number, status in enumerate((*system.LIVE, "SUCCESS")):
                name = f"work-{number}"
                system.enqueue(client, connection, "task", name, "render", {}, priority=1)
                connection.exec_driver_sql(
                    f"update dbos.workflow_status set status = '{status}' where workflow_uuid = '{name}'"
                )
        client.destroy()
    finally:
        database.close()
    with psycopg.connect(url, autocommit=True) as connection:
        connection.execute("drop role if exists diaphane_queue")
        connection.execute(re.sub(r"PASSWORD|DATABASE", lambda m: {"P": "secret"}.get(m[0][0], _name(url)), grants))
    limited = url.replace("postgres@", "diaphane_queue:secret@")
    with psycopg.connect(limited, autocommit=True) as connection:
        counted = {
            name: connection.execute(found.triggers[0].metadata.query).fetchone() for name, found in _scaled().items()
        }
        assert counted == {"render": (len(system.LIVE),), "label": (0,), "train": (0,)}
        for forbidden in ("select inputs from dbos.workflow_status", "select * from api_keys"):
            with pytest.raises(psycopg.errors.InsufficientPrivilege):
                connection.execute(forbidden)
    with psycopg.connect(url, autocommit=True) as connection:
        connection.execute("drop owned by diaphane_queue")
        connection.execute("drop role diaphane_queue")


def _name(url: str) -> str:
    return url.rpartition("/")[2]


def _block_of_the_readme(first: str) -> str:
    """The SQL of the instructions that begins with `first`."""
    text = (MANIFESTS.parent / "README.md").read_text(encoding="utf-8")
    (block,) = (block for block in re.findall(r"```sql\n(.*?)```", text, re.DOTALL) if block.startswith(first))
    return block


def _labels(deployment: dict[str, Any]) -> dict[str, str]:
    labels: dict[str, str] = deployment["spec"]["template"]["metadata"]["labels"]
    return labels


def _environment(name: str) -> dict[str, str]:
    """Variables of a deployment's container as far as they are not secret."""
    (container,) = deployments()[name]["spec"]["template"]["spec"]["containers"]
    (shared,) = (found["data"] for found in BASE if found["kind"] == "ConfigMap")
    own = {entry["name"]: entry["value"] for entry in container.get("env", [])}
    return {**shared, **own}


def _secrets_used() -> set[str]:
    used = set()
    for deployment in deployments().values():
        (container,) = deployment["spec"]["template"]["spec"]["containers"]
        used |= {entry["secretRef"]["name"] for entry in container["envFrom"] if "secretRef" in entry}
    return used
