"""`sbuffer`: exact. Every fragment in contiguous per-pixel runs, sorted, composited (Vasilakis and Fudos 2012).

Count, prefix sum, capture into a pool of exactly the right size (`renderer.techniques.runs`), then one pass that sorts
each run where it composites it. The pass has a shader for each class of tiles by their fullest pixel: up to 16
fragments are sorted in registers; up to 256 as blocks of 16 in registers, which are then merged; what is longer is
sorted in the pool by a work group a pixel before. `renderer.capture` makes the same runs in one geometry pass, but with
12 bytes a fragment and a list whose length it has to guess.
"""

from __future__ import annotations

import moderngl

from renderer.frame import Clock, Frame
from renderer.screen import ANY, TURNS, Class, read_linear, resolve_screen
from renderer.techniques.bands import Part
from renderer.techniques.base import Budget, Rendered, Technique, Twin
from renderer.techniques.runs import LONG, PIXEL_BYTES, Runs
from renderer.techniques.skips import frame_skips
from schemas.problem import ExitCode, Problem

_WORDS = 2
_BLOCK = 16
"""Fragments that are sorted in registers at once, at most."""
_IN_REGISTERS = (4, 8, _BLOCK)
_WAYS = (4, 16)
"""Sorted blocks that a shader merges; the last one serves all runs shorter than `LONG`."""
_CLASSES: tuple[Class, ...] = (
    *((slots, {"SLOTS": slots, "WAYS": 1}) for slots in _IN_REGISTERS),
    *((_BLOCK * ways, {"SLOTS": _BLOCK, "WAYS": ways}) for ways in _WAYS[:-1]),
    (ANY, {"SLOTS": _BLOCK, "WAYS": _WAYS[-1]}),
)


class SBuffer(Technique):
    """The exact picture."""

    name = "sbuffer"
    family = "exact"
    about = "contiguous runs a pixel, sorted"
    twin = Twin("exact")

    def render(self, frame: Frame, budget: Budget) -> Rendered:
        """Render a frame exactly. `budget` is not used: the pool holds all N fragments.

        `pool_bytes` are those of the whole window; above the limit of a storage buffer, bands of rows use one part of
        that size after the other.

        Raises:
            Problem: One row of the window alone does not fit a storage buffer, or one pixel has more fragments than a
                shader can visit.
        """
        clock = Clock(frame.ctx)
        runs = Runs(frame, clock, _WORDS)
        if runs.most > TURNS:
            raise Problem(
                f"A pixel has {runs.most:,} transparent fragments; one shader can visit {TURNS:,}.",
                "Ask for another view.",
                ExitCode.LIMIT,
            )
        image = frame.ctx.texture((frame.width, frame.height), 4, dtype="f4")
        for part in runs.parts():
            pool = runs.capture(part)
            runs.sort_long(part)
            with clock.measure("resolve"):
                _resolve(frame, runs, part, image)
            pool.release()
        linear = read_linear(frame, image)
        return Rendered(
            linear=linear,
            k=runs.read_counts(),
            passes={**frame.passes("opaque"), **clock.passes},
            captured=runs.total,
            pool_bytes=runs.pool_bytes,
            pixel_bytes=PIXEL_BYTES,
            skips=frame_skips(frame, runs.tiles),
        )


def _resolve(frame: Frame, runs: Runs, part: Part, image: moderngl.Texture) -> None:
    """Sort what is not sorted yet, and composite the bound runs."""
    resolve_screen(
        frame,
        "sbuffer/resolve.frag",
        [frame.background],
        {"WORDS": _WORDS, "LONG": LONG},
        (image, part.first, part.rows),
        runs.tiles,
        _CLASSES,
        base=part.base,
    )
