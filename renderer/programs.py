"""Shader programs: files under `renderer/shaders`, `#include`, and `#define`s put in after `#version`."""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import cache
from pathlib import Path

import moderngl

SHADERS = Path(__file__).parent / "shaders"
_INCLUDE = re.compile(r'^\s*#include\s+"([\w./-]+)"\s*$', re.MULTILINE)

Defines = Mapping[str, int | float]


@cache
def source(name: str) -> str:
    """The text of a shader file, `name` relative to `renderer/shaders`."""
    return (SHADERS / name).read_text(encoding="utf-8")


class Programs:
    """Compiled programs of one context, each compiled once.

    Args:
        ctx: The context.
    """

    def __init__(self, ctx: moderngl.Context) -> None:
        self._ctx = ctx
        self._compiled: dict[tuple[object, ...], moderngl.Program] = {}
        self._computes: dict[tuple[object, ...], moderngl.ComputeShader] = {}

    def get(self, vertex: str, fragment: str, defines: Defines | None = None) -> moderngl.Program:
        """The program of two shader files (relative to `renderer/shaders`)."""
        defines = defines or {}
        key = (vertex, fragment, *sorted(defines.items()))
        if key not in self._compiled:
            self._compiled[key] = self.linked(expand(vertex, defines), expand(fragment, defines))
        return self._compiled[key]

    def compute(
        self, name: str, defines: Defines | None = None, texts: Mapping[str, str] | None = None
    ) -> moderngl.ComputeShader:
        """The compute program of a file; `texts` are includes that are no files (a bundle's `predict.glsl`)."""
        defines, texts = defines or {}, texts or {}
        key = (name, *sorted(defines.items()), *sorted(texts.items()))
        if key not in self._computes:
            self._computes[key] = self.computing(expand(name, defines, texts))
        return self._computes[key]

    def linked(self, vertex: str, fragment: str) -> moderngl.Program:
        """A program of two texts."""
        return self._ctx.program(vertex_shader=vertex, fragment_shader=fragment)

    def computing(self, text: str) -> moderngl.ComputeShader:
        """A compute program of a text."""
        return self._ctx.compute_shader(text)


def expand(name: str, defines: Defines, texts: Mapping[str, str] | None = None) -> str:
    """A shader's text with includes resolved and defines put in.

    Args:
        name: File relative to `renderer/shaders`.
        defines: Names and numbers.
        texts: Includes that are given as text instead of files.
    """
    given = texts or {}

    def include(match: re.Match[str]) -> str:
        target = match[1]
        text = given[target] if target in given else source(target)
        return _INCLUDE.sub(include, text)

    version, _, body = source(name).partition("\n")
    if not version.startswith("#version"):
        version, body = "#version 450", source(name)
    header = "".join(f"#define {key} {value}\n" for key, value in defines.items())
    return f"{version}\n{header}{_INCLUDE.sub(include, body)}"
