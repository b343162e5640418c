"""The suites in their order, and how they are run: one that fails is a row, not the end."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Final

from evaluation.stress import bounds, gl_bounds
from evaluation.stress.findings import Broken, NotRun, Options, Row, Suite
from schemas.problem import Problem

_OURS: Final = ("schemas", "renderer", "labeller", "trainer", "evaluation", "stages", "services", "diaphane")


@dataclass(frozen=True, slots=True)
class Listed:
    """A suite, not imported before it runs.

    Attributes:
        name: Of the module in `evaluation.stress` that has its `run`.
        paths: The fast paths that its rows are of.
    """

    name: str
    paths: tuple[str, ...]

    def load(self) -> Suite:
        """Import it.

        Raises:
            ImportError: A library is not installed.
        """
        run: Suite = import_module(f"evaluation.stress.{self.name}").run
        return run


SUITES: Final = (
    Listed("curves", ("curves", "exponents", "composite", "reference", "transmittance", "csr")),
    Listed("allocations", ("hull", "selection", "greedy", "increment", "limits", "bands", "optimal")),
    Listed("fills", ("fill", "sum")),
    Listed("features", ("features",)),
    Listed("predictors", ("predict", "features.float16")),
    Listed("refusals", ("refused.arrays",)),
    Listed("search", ("curves.search", "predict.search")),
    Listed("gl", gl_bounds.PATHS),
)


def selected(only: Sequence[str]) -> tuple[Listed, ...]:
    """The suites that have rows of some paths; all for none.

    Args:
        only: Names of suites, or paths or their beginnings: `predict` is also `predict.onnx`.

    Raises:
        Problem: Nothing has such a name.
    """
    for name in only:
        if not any(_has(suite, name) for suite in SUITES):
            known = sorted({suite.name for suite in SUITES} | set(bounds.BOUNDS) | set(gl_bounds.PATHS))
            raise Problem(f"There is no fast path {name}.", f"Give one of: {', '.join(known)}.")
    return tuple(suite for suite in SUITES if not only or any(_has(suite, name) for name in only))


def rows_of(suite: Listed, options: Options, only: Sequence[str] = ()) -> Iterator[Row]:
    """The rows of a suite. An exception is a row that says so; a library that is missing is one, too.

    Args:
        suite: Which.
        options: How much is tried.
        only: As of `selected`: rows of other paths are left out.
    """
    try:
        for row in suite.load()(options):
            wanted = not only or suite.name in only or any(_begins(row.path, name) for name in only)
            # A driver that is missing is said whichever of its paths were asked for.
            whole = isinstance(row, NotRun) and not any(_begins(row.path, path) for path in suite.paths)
            if wanted or whole or isinstance(row, Broken):
                yield row
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] in _OURS:
            yield Broken(suite.name, _line(error))
        else:
            yield NotRun(suite.name, f"{error.name} not installed")
    except Exception as error:
        yield Broken(suite.name, _line(error))


def _has(suite: Listed, name: str) -> bool:
    return name == suite.name or any(_begins(path, name) or _begins(name, path) for path in suite.paths)


def _begins(path: str, name: str) -> bool:
    """Whether a path is that name, or a part of it: `predict.onnx` of `predict`, `gather · llvmpipe` of `gather`."""
    return path == name or path.startswith((f"{name}.", f"{name} "))


def _line(error: Exception) -> str:
    return " ".join(f"{type(error).__name__}: {error}".split())
