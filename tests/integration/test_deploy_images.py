"""The images' ingredients: the wheel, the locks, the steps."""

from __future__ import annotations

import re
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest
from support.deploy import CONTAINERS, ROOT, declared, pins, roles

PACKAGES = ("schemas", "renderer", "labeller", "trainer", "evaluation", "stages", "services", "diaphane")


def dockerfile() -> str:
    return (CONTAINERS / "Dockerfile").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("wheel")
    source = folder / "source"
    source.mkdir()
    for name in (*PACKAGES, "pyproject.toml", "README.md", "LICENSE"):
        subprocess.run(["cp", "-r", str(ROOT / name), str(source)], check=True)
    build = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--no-build-isolation", "--no-index"]
    subprocess.run([*build, "--wheel-dir", str(folder), str(source)], check=True)
    (built,) = folder.glob("*.whl")
    return built


def test_the_wheel_holds_every_file_of_the_packages(wheel: Path) -> None:
    """Also because the code versions of artifacts are made of these files: they must be the same everywhere."""
    held = {name for name in zipfile.ZipFile(wheel).namelist() if ".dist-info/" not in name}
    lying = {
        path.relative_to(ROOT).as_posix()
        for name in PACKAGES
        for path in (ROOT / name).rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    }
    assert held == lying


@pytest.mark.parametrize("role", sorted(roles()))
def test_an_image_has_the_versions_that_the_tests_ran_with(role: str) -> None:
    ours, tested = pins(CONTAINERS / f"requirements-{role}.lock"), pins(ROOT / "requirements.lock")
    assert {name: version for name, version in ours.items() if tested.get(name) != version} == {}
    assert declared(roles()[role]) <= set(ours)


@pytest.mark.parametrize("role", sorted(roles()))
def test_an_image_has_no_tools_of_the_developers(role: str) -> None:
    ours = set(pins(CONTAINERS / f"requirements-{role}.lock"))
    assert not ours & {"pytest", "mypy", "ruff", "moto", "schemathesis", "hypothesis"}


@pytest.mark.parametrize("lock", sorted(path.name for path in CONTAINERS.glob("*.lock")))
def test_a_lock_holds_hashes_and_no_addresses(lock: str) -> None:
    text = (CONTAINERS / lock).read_text(encoding="utf-8")
    assert "://" not in text
    entries = [entry for entry in re.split(r"\n(?=\S)", text.strip()) if not entry.startswith("#")]
    assert entries
    assert all("--hash=sha256:" in entry for entry in entries)


def test_every_role_has_an_image_that_is_not_root_and_tells_how_it_is() -> None:
    stages = {match[2]: match[0] for match in re.finditer(r"FROM (\S+) AS (\S+)\n(?:(?!FROM ).*\n)*", dockerfile())}
    assert set(roles()) <= set(stages)
    for role in roles():
        assert "USER 10001:10001\n" in stages[role]
        assert "HEALTHCHECK " in stages[role]
        assert f"packages.sh {role}\n" in stages[role]
        assert f"install.sh {role} " in stages[f"{role}-environment"]
    assert stages["render-gpu"].startswith("FROM render ")


def test_what_the_dockerfile_copies_is_there_and_not_ignored() -> None:
    allowed = {
        line[1:] for line in (ROOT / ".dockerignore").read_text(encoding="utf-8").splitlines() if line[:1] == "!"
    }
    copied = re.findall(r"^COPY (?!--from)(.+) \S+$", dockerfile(), re.MULTILINE)
    sources = {source.rstrip("/") for line in copied for source in line.split()}
    assert set(PACKAGES) <= sources
    for source in sources:
        assert (ROOT / source).exists()
        assert any(source == name or source.startswith(f"{name}/") for name in allowed), source


SCRIPTS = sorted(
    path.relative_to(ROOT).as_posix() for path in (*CONTAINERS.glob("*.sh"), *(ROOT / "scripts").glob("*.sh"))
)


@pytest.mark.parametrize("script", SCRIPTS)
def test_a_script_parses_and_can_be_run(script: str) -> None:
    path = ROOT / script
    subprocess.run(["bash", "-n", str(path)], check=True)
    assert bool(path.stat().st_mode & 0o111) == path.read_text(encoding="utf-8").startswith("#!")
