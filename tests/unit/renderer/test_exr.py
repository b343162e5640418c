"""Pictures as OpenEXR, and the camera in their headers."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from support.scenes import shells

from renderer.exr import camera_attributes, read_exr, write_exr
from renderer.exr_header import attribute, is_complete, packed
from schemas.colour import display8
from schemas.problem import Problem
from schemas.view import View

RNG = np.random.default_rng(3)


@pytest.mark.parametrize(("full", "bound"), [(True, 0.0), (False, 2.0**-11)])
def test_a_picture_comes_back(tmp_path: Path, full: bool, bound: float) -> None:
    linear = RNG.random((7, 5, 3)).astype(np.float32)
    write_exr(tmp_path / "a.exr", linear, full=full)
    assert np.abs(read_exr(tmp_path / "a.exr") / linear - 1.0).max() <= bound


def test_half_floats_keep_every_value_of_a_screen(tmp_path: Path) -> None:
    values = np.linspace(0.0, 1.0, 3 * 4096, dtype=np.float32).reshape(64, 64, 3)
    write_exr(tmp_path / "a.exr", values)
    steps = display8(read_exr(tmp_path / "a.exr")).astype(int) - display8(values)
    assert np.abs(steps).max() <= 1
    assert (steps != 0).mean() < 0.05


def test_the_header_says_what_made_it(tmp_path: Path) -> None:
    write_exr(tmp_path / "a.exr", np.zeros((4, 6, 3)), {"technique": "sbuffer", "g": 0.75, "frames": 3})
    with OpenEXR.File(str(tmp_path / "a.exr"), header_only=True) as file:
        header = dict(file.header())
    assert header["compression"] == OpenEXR.ZIP_COMPRESSION
    assert header["technique"] == "sbuffer"
    assert header["g"] == pytest.approx(0.75)
    assert header["frames"] == 3
    assert header["chromaticities"][:2] == pytest.approx((0.64, 0.33))
    assert header["dataWindow"][1].tolist() == [5, 3]


def test_what_is_no_picture_is_said_so(tmp_path: Path) -> None:
    (tmp_path / "a.exr").write_bytes(b"no")
    with OpenEXR.File({}, {"Y": np.zeros((2, 2), np.float32)}) as file:
        file.write(str(tmp_path / "y.exr"))
    for name in ("a.exr", "y.exr"):
        with pytest.raises(Problem, match="no OpenEXR picture"):
            read_exr(tmp_path / name)


@pytest.mark.parametrize("ortho", [None, 3.0])
def test_points_of_the_stage_fall_where_the_camera_sees_them(ortho: float | None) -> None:
    origin = np.array([5.0, -2.0, 1.0])
    scene = dataclasses.replace(shells(), origin=origin, metres_per_unit=0.01)
    view = View(name="v", eye=(0, 0, 5), target=(0, 0, 0), up=(0, 1, 0), fov=90.0, ortho_height=ortho)
    matrices = camera_attributes(view, scene, 200, 100)

    def seen(metres: tuple[float, float, float], name: str) -> np.ndarray:
        units = (np.array(metres) + origin) / 0.01
        return np.append(units, 1.0) @ np.asarray(matrices[name], dtype=np.float64)

    # Left-handed: right, up, ahead, in metres.
    np.testing.assert_allclose(seen((1.0, 2.0, 3.0), "worldToCamera")[:3], (1.0, 2.0, 2.0), atol=1e-4)
    half = 5.0 if ortho is None else 1.5  # of the picture's height, where the target is
    for metres, place in (((0, 0, 0), (0.5, 0.5)), ((-2 * half, half, 0), (0, 0)), ((2 * half, -half, 0), (1, 1))):
        clip = seen(metres, "worldToNDC")
        np.testing.assert_allclose(clip[:2] / clip[3], place, atol=1e-4)


def test_names_that_a_header_cannot_hold_are_refused() -> None:
    assert attribute("a", 1) == b"a\0int\0\x04\0\0\0\x01\0\0\0"
    with pytest.raises(ValueError, match="no name"):
        packed("x" * 32, "int", b"")


def test_a_file_that_was_cut_short_is_not_complete(tmp_path: Path) -> None:
    write_exr(tmp_path / "whole.exr", np.random.default_rng(0).random((40, 30, 3)))
    data = (tmp_path / "whole.exr").read_bytes()
    assert is_complete(data, 3)
    assert not any(is_complete(data[:end], 3) for end in range(len(data)))


@pytest.mark.parametrize("reason", ["says nothing", "raises"])
def test_a_picture_that_the_library_could_not_write_is_an_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, reason: str
) -> None:
    def write(_file: object, path: str) -> None:
        Path(path).write_bytes(b"v/1\x01")
        if reason == "raises":
            raise RuntimeError("No space left on device.")

    monkeypatch.setattr(OpenEXR.File, "write", write)
    with pytest.raises(OSError, match=r"No space left"):
        write_exr(tmp_path / "a.exr", np.zeros((2, 2, 3)))
