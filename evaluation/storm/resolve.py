"""Storm's resolve shader with another way to composite a pixel's list: a text, and nothing to compile."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Literal

from schemas.problem import ExitCode, Problem

Resolve = Literal["exact", "nearest"]
"""`exact`: the whole list, sorted. `nearest`: the nearest eight, and a tail of the others."""

SHADER = Path("hdx/resources/shaders/oitResolveImageShader.glslfx")
"""In a folder of OpenUSD's plug-ins."""

KNOWN = {"3aee4edaf8476054d0152b712992491ae5d209728c1a86989291eb573d580790": "25.02"}
"""SHA-256 of what Storm ships -> version of OpenUSD."""

_BEGIN, _END = "    vec4 sortedColor[maxSamples];\n", "    colorAccum = clamp(colorAccum, vec4(0), vec4(1));\n"
_READ = ("hdxOitCounterBuffer[screenIndex]", "hdxOitDataBuffer", "hdxOitDepthBuffer", "hdxOitIndexBuffer")
_PATCHED = "// Changed by `diaphane storm patch --apply`; `--revert` undoes it.\n"


def digest_of(text: str) -> str:
    """SHA-256 of a shader's text, hexadecimal."""
    return hashlib.sha256(text.encode()).hexdigest()


def is_patched(text: str) -> bool:
    """Whether `replaced` made this text."""
    return _PATCHED in text


def replaced(text: str, resolve: Resolve) -> str:
    """The shader with another resolve.

    Args:
        text: As Storm ships it.
        resolve: What composites a list.

    Raises:
        Problem: The text is not laid out as the ones that are known.
    """
    if text.count(_BEGIN) != 1 or text.count(_END) != 1 or not all(name in text for name in _READ):
        raise Problem(
            "The resolve shader of this OpenUSD has another layout than the known ones.",
            f"Use one whose {SHADER.name} sorts `sortedColor[maxSamples]`.",
            ExitCode.CONFLICT,
        )
    before, rest = text.split(_BEGIN)
    after = rest.split(_END)[1]
    own = (Path(__file__).parent / f"{resolve}.glsl").read_text(encoding="utf-8")
    count = "hdxOitCounterBuffer[0]"
    own = own.replace("POOL_COUNT", f"ATOMIC_LOAD({count})" if "ATOMIC_LOAD(" in text else count)
    return f"{before}    {_PATCHED}{own}{_END}{after}"
