"""How many transparent fragments the opaque surfaces hide: what the depth test saves every other pass."""

from __future__ import annotations

from renderer.frame import Frame


def hidden_fragments(frame: Frame) -> int:
    """Transparent fragments of a frame that are behind opaque ones; one more pass over the geometry, for reports.

    Args:
        frame: The view, its opaque pass done.
    """
    query = frame.ctx.query(samples=True)
    frame.ctx.depth_func = ">="
    try:
        with query:
            frame.draw_transparent("hidden/hidden.frag", frame.target([]))
    finally:
        frame.ctx.depth_func = "<"
    return int(query.samples)
