"""`sbuffer`: exact. Every fragment in contiguous per-pixel runs, sorted, composited (Vasilakis and Fudos 2012)."""

from __future__ import annotations

import numpy as np

from renderer.capture import capture
from renderer.frame import Clock, Frame
from renderer.techniques.base import Budget, Rendered
from renderer.techniques.chain import SLOT_BYTES, resolve_all


class SBuffer:
    """The exact picture."""

    name = "sbuffer"

    def render(self, frame: Frame, budget: Budget) -> Rendered:
        """Render a frame exactly. `budget` is not used: the pool holds all N fragments."""
        captured = capture(frame)
        dump = captured.dump
        clock = Clock(frame.ctx)
        with clock.measure("resolve"):
            image = resolve_all(frame, dump.offsets, dump.rgba.view("<u4").reshape(-1))
        pool = SLOT_BYTES * dump.total
        return Rendered(
            linear=image,
            k=dump.counts.astype(np.int32),
            passes={**captured.passes, **clock.passes},
            captured=dump.total,
            pool_bytes=pool,
            total_bytes=pool + frame.pixels * (12 + 4),
        )
