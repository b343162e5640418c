"""What the work of a role needs beyond the service itself, and what to install where that is missing."""

from __future__ import annotations

from collections.abc import Mapping
from importlib.util import find_spec
from typing import Final

from schemas.problem import ExitCode, Problem
from stages.tasks import ROLES, Role

NEEDED: Final[Mapping[Role, tuple[str, ...]]] = {
    "jobs": (),
    "render": ("moderngl", "numba", "pxr"),
    "label": ("numba",),
    "train": ("torch", "onnx", "onnxruntime", "moderngl"),
}
"""Packages as they are imported, of which one or another is left out where a role has no work."""

EXTRAS: Final[Mapping[Role, str]] = {"render": "render", "label": "label", "train": "train"}
"""Extras of pyproject.toml that bring them."""

WORK: Final[Mapping[Role, str]] = {"render": "Rendering", "label": "Labelling", "train": "Training"}
"""The work of a role, as a message begins."""


def missing(role: Role) -> tuple[str, ...]:
    """The packages that a role's work needs and that are not installed; nothing is imported to find out."""
    return tuple(name for name in NEEDED[role] if find_spec(name) is None)


def installed_roles() -> tuple[Role, ...]:
    """The roles whose work can be done with what is installed."""
    return tuple(role for role in ROLES if not missing(role))


def require(*roles: Role) -> None:
    """Checks before any work that all of it can be done.

    Raises:
        Problem: The work of one of them needs a package that is not installed.
    """
    for role in roles:
        if lacking := missing(role):
            verb = "is" if len(lacking) == 1 else "are"
            raise Problem(
                f"{WORK[role]} needs {' and '.join(lacking)}, which {verb} not installed.",
                f"Run `pip install 'diaphane[{EXTRAS[role]}]'`, and the same command again.",
                ExitCode.CHECK_FAILED,
            )
