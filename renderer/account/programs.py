"""Programs that tally: the same shaders, changed by `renderer.account.glsl`, and the buffer that they add to."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import moderngl
import numpy as np
from numpy.typing import NDArray

from renderer.account.glsl import BINDING, TALLIES, tallied
from renderer.programs import Programs

MOST_PROGRAMS: Final = 1024
"""Of a scene, for which there are tallies."""


@dataclass(frozen=True, slots=True)
class Tallied:
    """A program that tallies.

    Attributes:
        row: Of its tallies.
        samplers: Whose fetches it counts.
        shades: The field that its invocations count in; none for compute shaders.
    """

    row: int
    samplers: tuple[str, ...]
    shades: str | None


class TalliedPrograms(Programs):
    """Programs of a context that tally what they do.

    Args:
        ctx: The context.

    Attributes:
        known: By a program's name in GL.
    """

    def __init__(self, ctx: moderngl.Context) -> None:
        super().__init__(ctx)
        self.known: dict[int, Tallied] = {}
        self._rows: moderngl.Buffer | None = None

    def linked(self, vertex: str, fragment: str) -> moderngl.Program:
        """A program of two texts, of which the second one tallies."""
        found = tallied(fragment, is_fragment=True)
        made = super().linked(vertex, found.text)
        self._know(made, found.samplers, "fragments" if "in_position" in made else "pixels")
        return made

    def computing(self, text: str) -> moderngl.ComputeShader:
        """A compute program of a text, which tallies."""
        found = tallied(text, is_fragment=False)
        made = super().computing(found.text)
        self._know(made, found.samplers, None)
        return made

    def bind(self) -> None:
        """Bind the tallies, all of them zero."""
        if self._rows is None:
            self._rows = self._ctx.buffer(reserve=8 * TALLIES * MOST_PROGRAMS)
        self._rows.clear()
        self._rows.bind_to_storage_buffer(BINDING)

    def read(self) -> NDArray[np.int64]:
        """int64 [programs, TALLIES], since they were last read; then they are zero."""
        assert self._rows is not None, "bind is before"
        self._ctx.memory_barrier()
        size = 8 * TALLIES * len(self.known)
        if not size:
            return np.zeros((0, TALLIES), dtype=np.int64)
        found = np.frombuffer(self._rows.read(size), dtype="<u8").reshape(-1, TALLIES)
        self._rows.clear(size)
        return found.astype(np.int64)

    def _know(
        self, made: moderngl.Program | moderngl.ComputeShader, samplers: tuple[str, ...], shades: str | None
    ) -> None:
        row = len(self.known)
        if row >= MOST_PROGRAMS:
            raise RuntimeError(f"more than {MOST_PROGRAMS} programs are counted")
        # No constant of its text: a driver's cache of compiled shaders finds it again.
        made["tally_row"] = row
        self.known[made.glo] = Tallied(row, samplers, shades)
