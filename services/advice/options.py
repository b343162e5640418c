"""What a user can ask `diaphane advise` for, checked before any work starts."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from renderer.scene import LoadOptions
from schemas.advice import Size
from schemas.limits import LIMITS
from schemas.problem import ExitCode, Problem
from services.flags import parse_size
from services.options import check_bundle

DEFAULT_MEMORY: Final = "64MiB"
DEFAULT_SIZE: Final = "1920x1080"
PRETRAINED: Final = Path(__file__).resolve().parents[2] / "benchmarks" / "bundle"
"""The bundle of the repository, where this is one."""
_UNITS: Final = {"B": 1, "KB": 10**3, "MB": 10**6, "GB": 10**9, "KIB": 2**10, "MIB": 2**20, "GIB": 2**30}


@dataclass(frozen=True, slots=True)
class AdviceOptions:
    """What to advise on.

    Attributes:
        scenes: Files.
        memory: Bytes that all buffers of a frame may take.
        size: Of the picture that is to be rendered.
        views: A views file; None: the scene's cameras, else sampled views.
        load: How scenes are read.
        bundle: Folder of a bundle, or a name in the registry; None: the repository's, where it is there.
        state: Folder of the registry.

    Raises:
        Problem: Something of it cannot be.
    """

    scenes: tuple[Path, ...]
    memory: int
    size: Size
    views: Path | None = None
    load: LoadOptions = field(default_factory=LoadOptions)
    bundle: str | None = None
    state: Path = Path(".diaphane")

    def __post_init__(self) -> None:
        for scene in self.scenes:
            if not scene.is_file():
                raise Problem(f"There is no scene {scene}.", "Check the path.", ExitCode.NOT_FOUND)
        for side in (self.size.width, self.size.height):
            if not LIMITS.min_side <= side <= LIMITS.max_side:
                raise Problem(
                    f"Invalid size {self.size}: a side has {side} pixels.",
                    f"Give {LIMITS.min_side} to {LIMITS.max_side} pixels.",
                )
        check_bundle(self.bundle, "--bundle")

    @property
    def used_bundle(self) -> str | None:
        """The bundle that was asked for, else the repository's; None: there is none."""
        if self.bundle is None and PRETRAINED.is_dir():
            return str(PRETRAINED)
        return self.bundle


def parse_frame(text: str) -> Size:
    """A size of a frame, as in `1920x1080`.

    Raises:
        Problem: It is none.
    """
    width, height = parse_size(text)
    if not width or not height:
        raise Problem(f"Invalid size '{text}': it has no pixels.", "Write it like --size 1920x1080.")
    return Size(width=width, height=height)


def parse_memory(text: str) -> int:
    """Bytes of `64MiB`, `1.5 GiB` or `500MB`.

    Raises:
        Problem: It is no memory.
    """
    found = re.fullmatch(r"(\d+(?:\.\d+)?)\s*([KMG]?I?B)", text.strip().upper())
    count = int(float(found[1]) * _UNITS[found[2]]) if found and found[2] in _UNITS else 0
    if count < 1:
        raise Problem(f"Invalid memory '{text}'.", f"Write it like --memory {DEFAULT_MEMORY}, in KiB, MiB or GiB.")
    return count
