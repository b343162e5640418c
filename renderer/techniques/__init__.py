"""The ways to render transparency, by name: the same names in shaders, tests, manifests and reports."""

from renderer.techniques.base import Budget, Rendered, Technique
from renderer.techniques.kbuffer import KBuffer
from renderer.techniques.kbuffer_deep import KBufferDeep
from renderer.techniques.kbuffer_importance import KBufferImportance
from renderer.techniques.kbuffer_optimal import KBufferOptimal
from renderer.techniques.sbuffer import SBuffer

__all__ = [
    "Budget",
    "KBuffer",
    "KBufferDeep",
    "KBufferImportance",
    "KBufferOptimal",
    "Rendered",
    "SBuffer",
    "Technique",
]
