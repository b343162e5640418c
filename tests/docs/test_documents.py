"""The documents are complete and true: options, commands, folders, links, dependencies."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import pytest
import typer.main

from diaphane.cli import tables
from diaphane.cli.app import app

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("schemas", "renderer", "labeller", "trainer", "evaluation", "stages", "services", "diaphane")
FOLDERS = ("", "docs/", "benchmarks/", "evaluation/", "stages/", "deploy/", "deploy/retrain/", "deploy/client/*/")
DOCUMENTS = sorted(path.relative_to(ROOT).as_posix() for folder in FOLDERS for path in ROOT.glob(f"{folder}*.md"))

DISTRIBUTIONS = {
    "OpenEXR": "openexr",
    "PIL": "pillow",
    "pxr": "usd-core",
    "flip_evaluator": "flip-evaluator",
    "moderngl_window": "moderngl-window",
    "prometheus_client": "prometheus-client",
    "pydantic_settings": "pydantic-settings",
    "vl_convert": "vl-convert-python",
}
"""Import names that differ from the name of the distribution."""


def read(name: str) -> str:
    return (ROOT / name).read_text(encoding="utf-8")


def commands() -> dict[str, Any]:
    """Every command by the words that call it."""
    found: dict[str, Any] = {}

    def visit(command: Any, words: str) -> None:
        inner = getattr(command, "commands", None)
        if inner is None:
            found[words] = command
            return
        for name, child in inner.items():
            visit(child, f"{words} {name}")

    visit(typer.main.get_command(app), "diaphane")
    return found


@pytest.mark.parametrize("words", sorted(commands()))
def test_every_command_is_documented(words: str) -> None:
    assert words in read("docs/CLI.md")


@pytest.mark.parametrize("name", tables.FILES)
def test_options_are_said_as_the_commands_have_them(name: str) -> None:
    assert tables.rewritten(name, read(name)) == read(name), "run `python -m diaphane.cli.tables`"


def anchors(document: str) -> set[str]:
    """What links to a document can end with: its headings, as GitHub and the site name them."""
    text = re.sub(r"^ *```.*?^ *```", "", read(document), flags=re.MULTILINE | re.DOTALL)
    headings = re.findall(r"^#+ (.*)$", text, flags=re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading).strip().lower().replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("document", DOCUMENTS)
def test_links_lead_to_files_and_headings(document: str) -> None:
    folder = (ROOT / document).parent
    for target, anchor in re.findall(r"\]\(([^)#:\s]*)(?:#([^)]*))?\)", read(document)):
        file = (folder / target).resolve() if target else ROOT / document
        assert file.exists(), target
        assert not anchor or anchor in anchors(file.relative_to(ROOT).as_posix()), f"{target}#{anchor}"


@pytest.mark.parametrize("document", DOCUMENTS)
def test_lists_are_indented_for_the_site(document: str) -> None:
    """Python-Markdown continues an item after a blank line only at 4 spaces, where GitHub does at 2."""
    text = re.sub(r"^```.*?^```", "", read(document), flags=re.MULTILINE | re.DOTALL)
    assert re.findall(r"\n\n {1,3}\S.*|^ {1,3}(?:[-*]|\d+\.) .*", text, flags=re.MULTILINE) == []


def test_every_document_is_on_the_site() -> None:
    listed = set(re.findall(r": (\S+\.md)$", read("mkdocs.yml"), re.MULTILINE))
    assert {name for name in listed if not name.startswith("reference/")} == {
        *DOCUMENTS,
        "benchmarks/bundle/model_card.md",
    }


def test_the_readme_is_short() -> None:
    assert len(read("README.md").splitlines()) <= 120


def test_every_folder_is_in_the_architecture() -> None:
    listed = set(re.findall(r"^\| `([a-z./_-]+)/` \|", read("ARCHITECTURE.md"), re.MULTILINE))
    tracked = {path.parent.relative_to(ROOT) for name in PACKAGES for path in (ROOT / name).rglob("*.py")}
    folders = {path.as_posix() for path in tracked} | {"scripts", "tests", ".ci"}
    assert folders <= listed
    assert all((ROOT / name).is_dir() for name in listed)


def test_every_make_target_in_the_documents_exists() -> None:
    targets = set(re.findall(r"^([a-z]+):", read("Makefile"), re.MULTILINE))
    named = {
        name for document in DOCUMENTS for name in re.findall(r"(?:^|`)make ([a-z]+)", read(document), re.MULTILINE)
    }
    assert {"quickstart", "test"} <= named <= targets


def test_the_lock_holds_hashes_and_no_addresses() -> None:
    lock = read("requirements.lock") + read("docs/requirements.lock")
    assert "://" not in lock
    entries = [entry for entry in re.split(r"\n(?=\S)", lock.strip()) if not entry.startswith("#")]
    assert entries
    pinned = re.compile(r"[a-z0-9.-]+(?:\[[a-z0-9,-]+\])?==\S+")
    assert all(pinned.match(entry) and "--hash=sha256:" in entry for entry in entries)


def test_every_declared_dependency_is_locked() -> None:
    locked = set(re.findall(r"^([a-z0-9.-]+)(?:\[[a-z0-9,-]+\])?==", read("requirements.lock"), re.MULTILINE))
    assert declared() <= locked


def declared() -> set[str]:
    project = tomllib.loads(read("pyproject.toml"))["project"]
    groups = [project["dependencies"], *project["optional-dependencies"].values()]
    names = {re.split(r"[\[<>=! ]", requirement)[0].lower() for group in groups for requirement in group}
    return names - {"diaphane"}


def test_every_import_is_declared() -> None:
    known = declared() | set(PACKAGES) | {"diaphane_client"} | sys.stdlib_module_names
    missing = set()
    for path in (path for name in PACKAGES for path in (ROOT / name).rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names: list[str] = []
            if isinstance(node, ast.Import):
                names = [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom) and node.module:
                names = [node.module]
            tops = {name.partition(".")[0] for name in names}
            missing |= {(path.name, top) for top in tops if DISTRIBUTIONS.get(top, top) not in known}
    assert missing == set()


@pytest.mark.parametrize("script", ["scripts/setup.sh", "scripts/lock.sh", "scripts/docs.sh", ".ci/run"])
def test_scripts_are_executable_and_parse(script: str) -> None:
    assert (ROOT / script).stat().st_mode & 0o111
    subprocess.run(["bash", "-n", str(ROOT / script)], check=True)
