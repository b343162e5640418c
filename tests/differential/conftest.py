"""The frame that GL tests share: spheres twice each, so that depths tie, and a card of holes, glass and solid parts."""

from __future__ import annotations

import moderngl
import pytest
from support.scenes import SIZE, VIEW, shells

from renderer.capture import capture
from renderer.frame import Frame
from renderer.gpu_scene import GpuScene
from schemas.fragments import FragmentDump


@pytest.fixture(scope="module")
def frame(gl: moderngl.Context) -> Frame:
    return Frame(GpuScene(gl, shells()), VIEW, *SIZE)


@pytest.fixture(scope="module")
def dump(frame: Frame) -> FragmentDump:
    return capture(frame).dump
