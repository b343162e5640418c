"""Code versions follow the bytes of the sources, and nothing else."""

from __future__ import annotations

import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from evaluation import versions


@pytest.fixture
def tree(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    (tmp_path / "pack" / "shaders").mkdir(parents=True)
    (tmp_path / "pack" / "one.py").write_text("x = 1\n")
    (tmp_path / "pack" / "shaders" / "a.glsl").write_text("void main() {}\n")
    monkeypatch.setattr(versions, "ROOT", tmp_path)
    versions.code_version.cache_clear()
    yield tmp_path
    versions.code_version.cache_clear()


def fresh(*sources: str) -> str:
    versions.code_version.cache_clear()
    return versions.code_version(*sources)


def test_a_changed_source_is_another_version(tree: Path) -> None:
    package, module = fresh("pack"), fresh("pack.one")
    (tree / "pack" / "one.py").write_text("x = 2\n")
    assert fresh("pack") != package
    assert fresh("pack.one") != module


def test_a_changed_shader_is_another_version_of_its_package_only(tree: Path) -> None:
    package, module = fresh("pack"), fresh("pack.one")
    (tree / "pack" / "shaders" / "a.glsl").write_text("void main() { }\n")
    assert fresh("pack") != package
    assert fresh("pack.one") == module


def test_caches_and_the_order_of_names_do_not_matter(tree: Path) -> None:
    version = fresh("pack", "pack.one")
    (tree / "pack" / "__pycache__").mkdir()
    (tree / "pack" / "__pycache__" / "one.pyc").write_bytes(b"x")
    assert fresh("pack.one", "pack") == version


def test_a_renamed_file_is_another_version(tree: Path) -> None:
    version = fresh("pack")
    (tree / "pack" / "one.py").rename(tree / "pack" / "two.py")
    assert fresh("pack") != version


def test_an_unknown_source_is_an_error(tree: Path) -> None:
    with pytest.raises(FileNotFoundError, match=r"pack\.three"):
        fresh("pack.three")


def test_machine_and_libraries_are_named() -> None:
    assert int(versions.machine()["cores"]) >= 1
    assert versions.machine()["memory"].endswith("GiB")
    assert versions.library_versions()["python"].startswith("3.")
    assert "numpy" in versions.library_versions()


def test_what_a_benchmark_writes_leaves_the_commit_as_it_is(tree: Path) -> None:
    def git(*arguments: str) -> str:
        who = ("-c", "user.name=a", "-c", "user.email=a@b.c")
        run = subprocess.run(["git", *who, *arguments], cwd=tree, check=True, capture_output=True, text=True)
        return run.stdout.strip()

    (tree / "benchmarks" / "results").mkdir(parents=True)
    for name in ("BENCH.md", "results/bench.jsonl", "suite.py"):
        (tree / "benchmarks" / name).write_text("1\n")
    git("init", "-q")
    git("add", ".")
    git("commit", "-qm", "all")
    head = git("rev-parse", "HEAD")
    for name in ("BENCH.md", "results/bench.jsonl"):
        (tree / "benchmarks" / name).write_text("2\n")
    versions.commit.cache_clear()
    assert versions.commit() == head
    (tree / "benchmarks" / "suite.py").write_text("2\n")
    versions.commit.cache_clear()
    assert versions.commit() == f"{head}-dirty"
    versions.commit.cache_clear()
