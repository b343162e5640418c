"""What a user can ask `diaphane advise` for, checked before any work starts."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from evaluation.choices import check_bundle
from renderer.scene import LoadOptions
from schemas.advice import Size
from schemas.limits import LIMITS
from schemas.problem import ExitCode, Problem

PRETRAINED: Final = Path(__file__).resolve().parents[2] / "benchmarks" / "bundle"
"""The bundle of the repository, where this is one."""


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

    Raises:
        Problem: Something of it cannot be.
    """

    scenes: tuple[Path, ...]
    memory: int
    size: Size
    views: Path | None = None
    load: LoadOptions = field(default_factory=LoadOptions)
    bundle: str | None = None

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
