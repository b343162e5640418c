"""The frame that GL tests share: spheres twice each, so that depths tie, and a card of holes, glass and solid parts."""

from __future__ import annotations

import moderngl
import numpy as np
import pytest
from support.scenes import SIZE, VIEW, shells

from renderer.capture import capture
from renderer.frame import Frame
from renderer.gpu_scene import GpuScene
from renderer.screen import read_linear
from schemas.fragments import FragmentDump


@pytest.fixture(scope="module")
def frame(gl: moderngl.Context) -> Frame:
    return Frame(GpuScene(gl, shells()), VIEW, *SIZE, float_sums=True)


@pytest.fixture(scope="module")
def dump(frame: Frame) -> FragmentDump:
    return capture(frame).dump


@pytest.fixture
def unread_until_pictured(monkeypatch: pytest.MonkeyPatch) -> list[bool]:
    """Lets `kbuffer-deep` read no buffer before its picture; has an entry for each picture that it has read since."""
    pictures: list[bool] = []

    def read(self: moderngl.Buffer, *_: object, **__: object) -> bytes:
        assert pictures, "a buffer is read within the frame"
        return kept(self)

    def picture(frame: Frame, image: moderngl.Texture) -> np.ndarray:
        pictures.append(True)
        return read_linear(frame, image)

    kept = moderngl.Buffer.read
    monkeypatch.setattr(moderngl.Buffer, "read", read)
    monkeypatch.setattr(moderngl.Buffer, "read_into", read)
    monkeypatch.setattr("renderer.techniques.kbuffer_deep.read_linear", picture)
    return pictures
