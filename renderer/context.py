"""The one OpenGL context of this process: headless through EGL, or that of a window.

`python -m renderer.context` checks that it can be made.

Two contexts in one process silently answer for each other, and a fork after one exists hangs: worker processes are
spawned and make their own.
"""

from __future__ import annotations

import os
import sys
from typing import Any

import moderngl

from schemas.problem import ExitCode, Problem

PACKAGES = "libegl1 libgl1 libgl1-mesa-dri libegl-mesa0"
"""Debian/Ubuntu packages that make a context possible on a machine without a GPU."""


LEAST_VERSION = 450
"""OpenGL 4.5, as moderngl writes it."""

_context: moderngl.Context | None = None


def gl_context() -> moderngl.Context:
    """The process's context, made at the first call unless a window's was adopted.

    Returns:
        An OpenGL 4.5 core context.

    Raises:
        Problem: There is no driver, or it is older than OpenGL 4.5.
    """
    global _context
    if _context is None:
        _context = _headless()
    return _context


def adopt(context: moderngl.Context) -> None:
    """Make the context of a window, which is current, that of this process.

    Raises:
        Problem: It is older than OpenGL 4.5.
        RuntimeError: The process has another one already.
    """
    global _context
    if _context is not None:
        raise RuntimeError("this process has an OpenGL context already")
    if context.version_code < LEAST_VERSION:
        raise Problem(
            f"The window has OpenGL {context.version_code / 100:.1f}.",
            "OpenGL 4.5 is needed: update the driver.",
            ExitCode.CHECK_FAILED,
        )
    context.gc_mode = "auto"
    _context = context


def limit_threads() -> None:
    """Hold a software driver to our cores; to be called before there is a context."""
    # llvmpipe compiles every shader for the widest vectors it finds; this keeps its own worker count to our cores.
    os.environ.setdefault("LP_NUM_THREADS", str(min(16, len(os.sched_getaffinity(0)))))


def _headless() -> moderngl.Context:
    limit_threads()
    try:
        # moderngl hands further settings on to the backend, though its signature types them otherwise.
        settings: dict[str, Any] = {"backend": "egl"}
        ctx = moderngl.create_context(standalone=True, require=LEAST_VERSION, **settings)
    except Exception as reason:  # glcontext raises bare Exceptions of several kinds
        raise Problem(
            f"No OpenGL 4.5 context could be made ({reason}).",
            f"Install a driver: apt-get install --no-install-recommends {PACKAGES}",
            ExitCode.CHECK_FAILED,
        ) from reason
    ctx.gc_mode = "auto"
    return ctx


def describe(ctx: moderngl.Context) -> str:
    """Driver and version in words, for reports and provenance."""
    return f"{ctx.info['GL_RENDERER']}, OpenGL {ctx.info['GL_VERSION']}"


def is_software(description: str) -> bool:
    """Whether what `describe` says is a driver that renders on the processors."""
    return any(name in description.lower() for name in ("llvmpipe", "softpipe", "swrast", "swiftshader", "lavapipe"))


def main() -> int:
    """Print the driver, or why there is none."""
    try:
        print(describe(gl_context()))
    except Problem as problem:
        print(problem, file=sys.stderr)
        return int(problem.code)
    return 0


if __name__ == "__main__":
    sys.exit(main())
