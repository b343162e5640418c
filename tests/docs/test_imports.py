"""No module of the project imports itself by way of others: one could not read any of them first."""

from __future__ import annotations

from collections.abc import Mapping
from graphlib import CycleError, TopologicalSorter
from itertools import pairwise

import pytest
from support.imports import imported, module_files

from stages.closure import PACKAGES


def circle(imports: Mapping[str, set[str]]) -> list[str]:
    """Some modules of which each imports the next, the last one the first; none, if there is no circle."""
    try:
        TopologicalSorter(imports).prepare()
    except CycleError as error:
        return list(reversed(error.args[1]))
    return []


def test_imports_have_no_circles() -> None:
    modules = module_files(*PACKAGES, "diaphane", "benchmarks")
    assert circle({name: set(imported(path, modules)) for name, path in modules.items()}) == []


@pytest.mark.parametrize("imports", [{"a": {"b"}, "b": {"c"}, "c": {"a"}}, {"a": {"b", "c"}, "b": {"a"}}, {"a": {"a"}}])
def test_a_circle_is_found(imports: Mapping[str, set[str]]) -> None:
    found = circle(imports)
    assert found[0] == found[-1]
    assert all(later in imports[earlier] for earlier, later in pairwise(found))


def test_without_a_circle_there_is_none() -> None:
    assert circle({"a": {"b", "c"}, "b": {"c"}}) == []
