"""Frames in usdrecord's words."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pxr import Usd, UsdGeom, UsdUtils

from renderer.timecodes import check_pattern, is_animated, numbered, parse_frames
from schemas.problem import ExitCode, Problem


@pytest.mark.parametrize(
    ("text", "frames"),
    [
        ("123", (123.0,)),
        ("101:105", (101.0, 102.0, 103.0, 104.0, 105.0)),
        ("105:101", (105.0, 104.0, 103.0, 102.0, 101.0)),
        ("101:110x2", (101.0, 103.0, 105.0, 107.0, 109.0)),
        ("101:102x0.5", (101.0, 101.5, 102.0)),
        ("-2:0", (-2.0, -1.0, 0.0)),
        ("5:1x-2", (5.0, 3.0, 1.0)),
        ("1,5:6, 3", (1.0, 5.0, 6.0, 3.0)),
    ],
)
def test_frame_specs(text: str, frames: tuple[float, ...]) -> None:
    assert parse_frames(text) == frames


@given(st.integers(-50, 50), st.integers(-50, 50), st.sampled_from((None, 1, 2, 0.5, 0.1, 3.7)))
def test_time_codes_are_those_of_usd(start: int, end: int, stride: float | None) -> None:
    sign = 1 if end >= start else -1
    text = f"{start}:{end}" + ("" if stride is None else f"x{sign * stride}")
    expected = [time.GetValue() for time in UsdUtils.TimeCodeRange.CreateFromFrameSpec(text)]
    assert list(parse_frames(text)) == expected


@pytest.mark.parametrize("text", ["", "a", "1:", "1:2:3", "5:1x2", "1:5x0", "1,,2", "nan", "inf", "1:inf"])
def test_what_is_no_frame_spec_is_said_so(text: str) -> None:
    with pytest.raises(Problem, match="no list of frames"):
        parse_frames(text)


def test_too_many_frames_are_refused_before_they_are_listed() -> None:
    with pytest.raises(Problem) as caught:
        parse_frames("1:1000000000000")
    assert caught.value.code == ExitCode.LIMIT


@pytest.mark.parametrize(
    ("pattern", "frame", "name"),
    [
        ("out.####.png", 7.0, "out.0007.png"),
        ("out.####.png", 12345.0, "out.12345.png"),
        ("out#.exr", 3.0, "out3.exr"),
        ("a.###.##.png", 1.5, "a.001.50.png"),
        ("a.###.png", -1.0, "a.-01.png"),
        ("plain.png", 7.0, "plain.png"),
    ],
)
def test_numbers_go_where_the_hashes_are(pattern: str, frame: float, name: str) -> None:
    assert numbered(Path("some.#.folder") / pattern, frame) == Path("some.#.folder") / name


@pytest.mark.parametrize(
    ("pattern", "frames", "words"),
    [
        ("out.png", (1.0, 2.0), "All frames"),
        ("a.#.b.#.png", (1.0,), "more than one place"),
        ("out.##.png", (1.0, 1.25), "too few decimals"),
    ],
)
def test_files_that_would_be_overwritten_are_refused(pattern: str, frames: tuple[float, ...], words: str) -> None:
    with pytest.raises(Problem, match=words):
        check_pattern(Path(pattern), frames)


@given(st.lists(st.integers(-999, 9999), min_size=1, max_size=20), st.integers(1, 6))
def test_every_whole_frame_has_a_file_of_its_own(frames: list[int], hashes: int) -> None:
    times = tuple(float(frame) for frame in frames)
    pattern = Path(f"x.{'#' * hashes}.png")
    check_pattern(pattern, times)
    assert len({numbered(pattern, time) for time in times}) == len(set(times))


def test_a_moving_camera_alone_is_no_animation() -> None:
    stage = Usd.Stage.CreateInMemory()
    camera = UsdGeom.Camera.Define(stage, "/Camera")
    camera.AddTranslateOp().Set((1, 2, 3), 1.0)
    cube = UsdGeom.Cube.Define(stage, "/Cube")
    assert not is_animated(stage)
    cube.CreateSizeAttr().Set(2.0, 1.0)
    assert is_animated(stage)


def test_animation_counts_wherever_it_is_authored(tmp_path: Path) -> None:
    inner = Usd.Stage.CreateNew(str(tmp_path / "inner.usda"))
    cube = UsdGeom.Cube.Define(inner, "/Cube")
    cube.AddTranslateOp().Set((1, 2, 3), 1.0)
    inner.SetDefaultPrim(cube.GetPrim())
    inner.Save()
    stage = Usd.Stage.CreateInMemory()
    stage.DefinePrim("/A").GetReferences().AddReference(str(tmp_path / "inner.usda"))
    assert is_animated(stage)
