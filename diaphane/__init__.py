"""Diaphane in notebooks and pipelines: scenes, pictures, fragments, allocations, advice, builds and servers.

Everything here is what the `diaphane` command does, handed over as arrays and objects that show themselves in Jupyter.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from diaphane.advice import Advised, advise
    from diaphane.building import Built, build
    from diaphane.client import Client
    from diaphane.fragments import Allocations, Fragments, allocate
    from diaphane.picture import Picture
    from diaphane.scene import Scene, open
    from schemas.problem import Problem

__all__ = [
    "Advised",
    "Allocations",
    "Built",
    "Client",
    "Fragments",
    "Picture",
    "Problem",
    "Scene",
    "advise",
    "allocate",
    "build",
    "open",
]

_HOMES: Final = {
    "Advised": "diaphane.advice",
    "Allocations": "diaphane.fragments",
    "Built": "diaphane.building",
    "Client": "diaphane.client",
    "Fragments": "diaphane.fragments",
    "Picture": "diaphane.picture",
    "Problem": "schemas.problem",
    "Scene": "diaphane.scene",
    "advise": "diaphane.advice",
    "allocate": "diaphane.fragments",
    "build": "diaphane.building",
    "open": "diaphane.scene",
}


def __getattr__(name: str) -> Any:
    # On first use: a pipeline that only asks a server needs neither OpenGL nor numba.
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
