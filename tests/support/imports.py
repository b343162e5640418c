"""Imports of the project's modules as Python's parser sees them: the twin of `stages.closure`."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from evaluation.versions import ROOT
from stages.closure import PACKAGES


@cache
def module_files(*packages: str) -> dict[str, Path]:
    """Dotted name -> file of every module of some top-level packages, those of the project by default."""
    paths = (path for package in packages or PACKAGES for path in (ROOT / package).rglob("*.py"))
    return {_dotted(path): path for path in paths}


def statements(tree: ast.AST) -> Iterator[ast.Import | ast.ImportFrom]:
    """Every import that is run at some time: not those that only type checkers read."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING":
            for other in node.orelse:
                yield from statements(other)
        elif isinstance(node, ast.Import | ast.ImportFrom):
            yield node
        elif not isinstance(node, ast.expr):
            yield from statements(node)


def imported(path: Path, modules: dict[str, Path]) -> Iterator[str]:
    """Names of the modules that a module imports: the innermost ones, without the packages that they lie in.

    Args:
        path: The file.
        modules: What is looked for.
    """
    for node in _statements_of(path):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name in modules)
        else:
            assert node.level == 0, f"{path} has a relative import"
            inner = {f"{node.module}.{alias.name}" for alias in node.names}
            yield from inner & modules.keys()
            if node.module in modules and not inner <= modules.keys():
                yield node.module


@cache
def _statements_of(path: Path) -> list[ast.Import | ast.ImportFrom]:
    return list(statements(ast.parse(path.read_bytes())))


def _dotted(path: Path) -> str:
    return ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")
