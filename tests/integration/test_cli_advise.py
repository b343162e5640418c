"""`diaphane advise` as users call it."""

from __future__ import annotations

import json
from pathlib import Path

import moderngl
import pytest

from diaphane.cli.app import run
from renderer.samples import SAMPLES
from schemas.advice import Advice
from schemas.problem import ExitCode

SMALL = ["--size", "48x32", "--views", "views.json"]
VIEW = {"eye": [120, 60, 70], "target": [0, 0, 20], "up": [0, 0, 1], "fov": 35}


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory, gl: moderngl.Context) -> Path:
    return SAMPLES["nested_shells"](tmp_path_factory.mktemp("scene"))


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, scene: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    listed = [{"main": str(file), "views": [VIEW]} for file in (scene, tmp_path / "opaque.obj")]
    (tmp_path / "views.json").write_text(json.dumps({"scenes": listed}))
    monkeypatch.delenv("DIAPHANE_STATE", raising=False)
    return tmp_path


def advised(capsys: pytest.CaptureFixture[str], *arguments: str) -> Advice:
    assert run(["advise", *arguments, "--json"]) == ExitCode.OK
    return Advice.model_validate(json.loads(capsys.readouterr().out)["scenes"][0])


def test_it_says_what_to_use_and_leaves_a_page(scene: Path, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["advise", str(scene), *SMALL, "--memory", "33KiB", "-o", "page.html"]) == ExitCode.OK
    told = capsys.readouterr().out
    page = (folder / "page.html").read_text(encoding="utf-8")
    assert "the least error that fits" in told
    assert f"diaphane render {scene} --views views.json -t " in told
    assert '<script type="application/json">' in page
    assert page.count("data:image/webp") == 5
    assert "http://" not in page.replace("http://www.w3.org", "")


def test_the_numbers_are_those_of_the_scene_and_do_not_change(
    scene: Path, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    first = advised(capsys, str(scene), *SMALL)
    assert first.choice.verdict == "exact"
    assert first == advised(capsys, str(scene), *SMALL)
    assert {work.technique for work in first.work} >= {"sbuffer"}
    assert {one.family for one in first.scene.candidates} == {"exact", "bounded", "approximate"}
    assert not (folder / "advice.html").exists()


def test_a_scene_in_which_nothing_is_transparent_needs_nothing(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (folder / "opaque.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    found = advised(capsys, "opaque.obj", *SMALL)
    assert (found.choice.verdict, found.best) == ("nothing", ())
    assert "diaphane advise opaque.obj --alpha .33 --views views.json" in found.commands


@pytest.mark.parametrize(
    ("arguments", "title"),
    [
        (["none.usd"], "There is no scene none.usd."),
        (["{scene}", "--memory", "much"], "Invalid memory 'much'."),
        (["{scene}", "--size", "4x4"], "Invalid size 4x4"),
        (["{scene}", "--bundle", "/no/such"], "/no/such"),
    ],
)
def test_bad_input_says_what_to_do(
    scene: Path, arguments: list[str], title: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["advise", *(part.format(scene=scene) for part in arguments)]) != ExitCode.OK
    assert title in capsys.readouterr().err
