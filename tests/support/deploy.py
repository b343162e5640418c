"""What lies in `deploy/` and `docker-compose.yml`, as data."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from importlib import metadata
from pathlib import Path
from typing import Any

import yaml
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).resolve().parents[2]
CONTAINERS = ROOT / "deploy" / "containers"
MANIFESTS = ROOT / "deploy" / "k8s"

VARIABLE = re.compile(r"\$\{(?P<name>[A-Z_]+)(?P<rule>:[-?])?(?P<text>[^}]*)\}")
"""`${NAME}`, `${NAME:-default}`, `${NAME:?message}`."""


def compose() -> dict[str, Any]:
    """docker-compose.yml with anchors and merges resolved, variables not."""
    document: dict[str, Any] = yaml.safe_load((ROOT / "docker-compose.yml").read_text(encoding="utf-8"))
    return document


def services() -> dict[str, dict[str, Any]]:
    """Its services."""
    found: dict[str, dict[str, Any]] = compose()["services"]
    return found


def own_services() -> dict[str, dict[str, Any]]:
    """Those that run Diaphane."""
    return {name: service for name, service in services().items() if service["image"].startswith("diaphane/")}


def filled_in(value: str, variables: Mapping[str, str]) -> str:
    """A value with its variables replaced, as docker compose does."""

    def replace(match: re.Match[str]) -> str:
        name, rule, text = match["name"], match["rule"], match["text"]
        if variables.get(name):
            return variables[name]
        assert rule == ":-", f"{name} has no value and no default"
        return text

    return VARIABLE.sub(replace, value)


def manifests(folder: str) -> Iterator[dict[str, Any]]:
    """Kubernetes objects of a folder, without kustomize's own."""
    for path in sorted((MANIFESTS / folder).glob("*.yaml")):
        for document in yaml.safe_load_all(path.read_text(encoding="utf-8")):
            if document["kind"] != "Kustomization":
                yield document


def deployments() -> dict[str, dict[str, Any]]:
    """Deployments by name."""
    return {found["metadata"]["name"]: found for found in manifests("base") if found["kind"] == "Deployment"}


def roles() -> dict[str, tuple[str, ...]]:
    """Extras of each image."""
    lines = (CONTAINERS / "roles").read_text(encoding="utf-8").splitlines()
    rows = (line.split() for line in lines if line and not line.startswith("#"))
    return {row[0]: tuple(row[1].split(",")) for row in rows}


def pins(lock: Path) -> dict[str, str]:
    """Versions in a lock, by distribution; several versions of one, for different platforms, are joined."""
    found: dict[str, list[str]] = {}
    for name, version in re.findall(r"^([a-z0-9.-]+)==([^ ;\\]+)", lock.read_text(encoding="utf-8"), re.MULTILINE):
        found.setdefault(name, []).append(version)
    return {name: " ".join(sorted(versions)) for name, versions in found.items()}


def declared(extras: tuple[str, ...]) -> set[str]:
    """Distributions that pyproject.toml asks for, for some extras."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    groups = [project["dependencies"], *(project["optional-dependencies"][extra] for extra in extras)]
    return {re.split(r"[\[<>=! ]", requirement)[0] for group in groups for requirement in group}


def closure(*extras: str) -> set[str]:
    """Distributions that an installation here with some extras consists of, from what each one installed asks for."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    groups = [project["dependencies"], *(project["optional-dependencies"][extra] for extra in extras)]
    waiting = [(text, "") for group in groups for text in group]
    found: set[tuple[str, str]] = set()
    while waiting:
        text, extra = waiting.pop()
        asked = Requirement(text)
        name = canonicalize_name(asked.name)
        if asked.marker is not None and not asked.marker.evaluate({"extra": extra}):
            continue
        for part in ("", *asked.extras):
            if (name, part) in found:
                continue
            found.add((name, part))
            if name == project["name"]:
                waiting += [(own, "") for own in project["optional-dependencies"].get(part, ())]
            else:
                waiting += [(own, part) for own in metadata.requires(name) or ()]
    return {name for name, _ in found}


BLOCK = 4096
BYTECODE = 1.3
"""Blocks of the bytecode of what pip installs and compiles, per block of its source: measured on the extra `render`."""


def installed_bytes(names: Iterable[str]) -> float:
    """What some distributions, as they are installed here, take up on a disk once they are compiled."""
    sizes = [
        (file.suffix, -(-(file.size or 0) // BLOCK) * BLOCK)
        for name in names
        for file in metadata.files(name) or ()
        if file.suffix != ".pyc"
    ]
    return sum(size * (1.0 + BYTECODE * (suffix == ".py")) for suffix, size in sizes)
