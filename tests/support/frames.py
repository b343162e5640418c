"""What tests change about frames."""

from __future__ import annotations

import moderngl
import pytest

from renderer.frame import Frame


def float_sums(patch: pytest.MonkeyPatch) -> None:
    """Let a binned tail's sums be float32, so that nothing but its arithmetic is between it and its twin."""
    made = Frame.targets

    def targets(self: Frame, count: int, dtype: str, components: int = 4) -> list[moderngl.Texture]:
        return made(self, count, "f4", components)

    patch.setattr(Frame, "targets", targets)
