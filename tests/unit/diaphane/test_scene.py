"""Scenes in a program: the same pictures and fragments as those of the commands."""

from __future__ import annotations

from pathlib import Path

import moderngl
import numpy as np
import pytest
from PIL import Image

import diaphane
from diaphane.cli.app import run
from renderer.dump import read_dump
from renderer.samples import SAMPLES
from schemas.problem import ExitCode, Problem

PLY = """ply
format ascii 1.0
element vertex 3
property float x
property float y
property float z
element face 1
property list uchar int vertex_indices
end_header
0 0 0
1 0 0
0 1 0
3 0 1 2
"""
SIZE = ["--size", "48x32"]


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, gl: moderngl.Context) -> Path:
    monkeypatch.chdir(tmp_path)
    SAMPLES["curtains"](tmp_path)
    return tmp_path


def test_pictures_are_those_of_the_command(folder: Path) -> None:
    with diaphane.open("curtains.usdc") as scene:
        camera = scene.cameras[-1]
        assert run(["render", "curtains.usdc", "-t", "kbuffer", "--budget", ".5", "-cam", camera, *SIZE]) == ExitCode.OK
        picture = scene.render("kbuffer", 0.5, camera=camera, size=(48, 32), compare=True)
        exact = scene.render(camera=camera, size=(48, 32))
    assert np.array_equal(picture.srgb, np.asarray(Image.open("curtains.png")))
    assert picture.cost.file is None
    assert picture.cost.budget == 768
    assert picture.cost.mse == pytest.approx(np.mean((picture.srgb / 255.0 - exact.srgb / 255.0) ** 2), rel=1e-6)
    picture.save("saved.png")
    assert np.array_equal(np.asarray(Image.open("saved.png")), picture.srgb)
    assert np.asarray(picture) is picture.linear
    assert np.array(picture, dtype=np.float64).dtype == np.float64


def test_fragments_are_those_of_the_command() -> None:
    assert run(["dump", "curtains.usdc", "-o", "dumped", *SIZE]) == ExitCode.OK
    dumped = read_dump(Path("dumped"))
    with diaphane.open("curtains.usdc") as scene:
        fragments = scene.fragments(size=(48, 32))
    assert fragments.total > 0
    for name in ("offsets", "rgba", "depth", "background", "facing"):
        assert np.array_equal(getattr(fragments, name), getattr(dumped, name)), name


def test_what_is_converted_is_deleted_with_the_scene(folder: Path) -> None:
    (folder / "triangle.ply").write_text(PLY)
    with diaphane.open("triangle.ply", alpha=0.5) as scene:
        converted = scene._local._usd
        assert converted.is_file()
        assert scene.fragments(size=(16, 16)).counts.max() == 1
        assert "triangle.ply" in scene._repr_html_()
    assert not converted.exists()


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        ({"technique": "no"}, "no technique 'no'"),
        ({"camera": "no"}, "no camera 'no'"),
        ({"budget": -1.0}, "budget of -1"),
        ({"size": (0, 4)}, "Invalid size"),
        ({"tail": "no"}, "no tail 'no'"),
        ({"bundle": "no@champion", "technique": "kbuffer-deep"}, "no"),
    ],
)
def test_mistakes_say_what_to_do(asked: dict[str, object], words: str) -> None:
    with diaphane.open("curtains.usdc") as scene, pytest.raises(Problem, match=words) as caught:
        scene.render(**asked)  # type: ignore[arg-type]
    assert caught.value.remedy
