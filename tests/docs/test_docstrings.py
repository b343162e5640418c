"""Every public function that takes arrays says of each what it is: the reference of the site is made of that."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = (
    "schemas",
    "renderer",
    "labeller",
    "trainer",
    "evaluation",
    "stages",
    "services",
    "diaphane",
    "deploy/client/python/diaphane_client",
)
ARRAYS = re.compile(r"\b(?:NDArray|ndarray|ArrayLike)\b")


def functions(body: list[ast.stmt], prefix: str = "") -> Iterator[tuple[str, ast.FunctionDef]]:
    """Public functions and methods of public classes, by their names."""
    for node in body:
        if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
            yield from functions(node.body, f"{prefix}{node.name}.")
        elif isinstance(node, ast.FunctionDef) and not node.name.startswith("_"):
            yield f"{prefix}{node.name}", node


def undocumented(function: ast.FunctionDef) -> list[str]:
    """Arguments that `Args` does not name, where one of them is an array."""
    arguments = [*function.args.posonlyargs, *function.args.args, *function.args.kwonlyargs]
    if not any(a.annotation and ARRAYS.search(ast.unparse(a.annotation)) for a in arguments):
        return []
    described = (ast.get_docstring(function) or "").partition("Args:")[2]
    return [
        a.arg
        for a in arguments
        if a.arg not in ("self", "cls") and not re.search(rf"^ +\*{{0,2}}{a.arg}:", described, re.MULTILINE)
    ]


@pytest.mark.parametrize("package", PACKAGES)
def test_functions_of_arrays_document_every_argument(package: str) -> None:
    missing = {
        f"{path.relative_to(ROOT)}: {name}": arguments
        for path in sorted((ROOT / package).rglob("*.py"))
        for name, function in functions(ast.parse(path.read_text(encoding="utf-8")).body)
        if (arguments := undocumented(function))
    }
    assert missing == {}


def test_an_argument_without_words_is_found() -> None:
    source = 'def f(a: NDArray, b: int):\n    """F.\n\n    Args:\n        a: float64 [P].\n    """'
    (function,) = ast.parse(source).body
    assert isinstance(function, ast.FunctionDef)
    assert undocumented(function) == ["b"]
