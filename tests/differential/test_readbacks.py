"""What is read back before a picture: nothing, or the two words that a pool and the number of passes depend on."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import moderngl
import pytest
from support.scenes import SIZE, VIEW, shells

from renderer.frame import Frame
from renderer.gpu_scene import GpuScene
from renderer.techniques import TECHNIQUES, Budget, technique

TOTALS = 8
"""N and max(n)."""
READ = {
    "abuffer-list": TOTALS,
    "abuffer-array": TOTALS,
    "sbuffer": TOTALS,
    "multilayer": TOTALS,
    "adaptive": TOTALS,
    "depth-peeling": TOTALS,
    "dual-depth-peeling": TOTALS + 4,
    "binned": 0,
    "weighted-average": 0,
    "weighted-blended": 0,
    "moment": 0,
    "stochastic": 0,
    "wavelet": 0,
    "bevy": TOTALS,
    "storm-rules": TOTALS,
}


def test_every_exact_and_approximate_technique_is_here() -> None:
    assert set(READ) == {name for name, entry in TECHNIQUES.items() if entry.family != "bounded"}


@pytest.mark.parametrize("name", READ)
def test_no_more_is_read_before_the_picture__name(
    gl: moderngl.Context, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    fresh = Frame(GpuScene(gl, shells(duplicates=1)), VIEW, *SIZE)
    read: list[int] = []
    pictures: list[int] = []

    def counting(original: Callable[..., Any]) -> Callable[..., Any]:
        def wrapped(self: moderngl.Buffer, *args: Any, **kwargs: Any) -> Any:
            found = original(self, *args, **kwargs)
            if not pictures:
                read.append(len(found) if isinstance(found, bytes) else self.size)
            return found

        return wrapped

    def picture(self: moderngl.Texture, *args: Any, **kwargs: Any) -> bytes:
        pictures.append(self.glo)
        found: bytes = kept(self, *args, **kwargs)
        return found

    kept = moderngl.Texture.read
    monkeypatch.setattr(moderngl.Texture, "read", picture)
    for method in ("read", "read_into", "read_chunks", "read_chunks_into"):
        monkeypatch.setattr(moderngl.Buffer, method, counting(getattr(moderngl.Buffer, method)))
    rendered = technique(name).render(fresh, Budget(0))
    assert len(pictures) == 1
    assert rendered.linear.any()
    assert sum(read) == READ[name]
