"""`diaphane bench` as users call it, and the committed suite's script on one small scene."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import moderngl
import pytest

import services
from benchmarks import suite
from benchmarks.casting.cases import Case
from benchmarks.comparing import scenes
from benchmarks.comparing.scenes import PATH_FRAMES, SHARED, cases_of, parts_of
from diaphane.cli.app import run
from evaluation.bench.kept import ROWS
from evaluation.summary import UNFIT, said_unfit
from labeller.budgets import default_budgets
from renderer import capture, exact_bytes
from renderer.samples import SAMPLES
from renderer.samples.deep import DEEP
from renderer.techniques import bands
from schemas.bench import BenchResult
from schemas.bundle import load_manifest
from schemas.limits import LIMITS
from schemas.problem import ExitCode

ROOT = Path(services.__file__).parent.parent
FAST = ["--size", "48x32", "--repeats", "1", "--alpha", ".33", "--equal-fragments", "--no-account"]


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory, gl: moderngl.Context) -> Path:
    return SAMPLES["nested_shells"](tmp_path_factory.mktemp("scene"))


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("DIAPHANE_STATE", raising=False)
    return tmp_path


def answer(capsys: pytest.CaptureFixture[str], *arguments: str) -> dict[str, Any]:
    assert run(["bench", *arguments, "--json"]) == ExitCode.OK
    found: dict[str, Any] = json.loads(capsys.readouterr().out)
    return found


def test_it_prints_tables_and_leaves_json_plots_and_a_page(
    scene: Path, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    command = [
        "bench",
        str(scene),
        *FAST,
        "-o",
        "out",
        "-t",
        "sbuffer,moment,kbuffer,kbuffer-optimal",
        "--budgets",
        "1",
        "--account",
        "--bandwidth",
        "250",
    ]
    assert run(command) == ExitCode.OK
    out = capsys.readouterr().out
    assert "at 250 GB/s and 50 Gfragments/s, no prediction" in out
    assert "nested_shells, alpha 0.33, 48x32: 1 view" in out
    assert "Algorithm 1 (offline), weighted-average tail" in out
    assert out.strip().endswith("out/index.html")
    result = BenchResult.model_validate_json((folder / "out" / "bench.json").read_text())
    cells = {cell.technique: cell for cell in result.views[0].cells}
    assert cells["sbuffer"].mse == 0.0
    assert 0.0 < (cells["kbuffer-optimal"].score or 0.0) <= (cells["kbuffer"].score or 0.0)
    assert cells["sbuffer"].work["capture"].atomics == result.views[0].fragments
    assert cells["kbuffer-optimal"].work.keys() == cells["kbuffer-optimal"].passes.keys() - {"opaque", "readback"}
    assert result.device.bandwidth == 250.0
    for plot in ("time-error", "error-bytes", "figure6-1"):
        assert json.loads((folder / "out" / f"{plot}.vl.json").read_text())["data"]["values"]
    page = (folder / "out" / "index.html").read_text()
    assert page.count("<img") == 5, "the view, and its spot: exact, moment, kbuffer, kbuffer-optimal"
    assert "Work of a frame, counted" in page
    assert "250 GB/s and 50 Gfragments/s" in page
    assert not (folder / ".diaphane").exists(), "it runs without state"


def test_budgets_that_are_not_given_follow_from_each_scene_and_opacity(
    scene: Path, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    command = ["bench", str(scene), "--size", "48x32,32x48", "--repeats", "1", "--equal-fragments", "-t", "kbuffer"]
    assert run([*command, "-o", "out", "--budgets", "64"]) == ExitCode.OK
    said = capsys.readouterr().err
    assert "nested_shells, authored alpha: The budget 64 holds all fragments" in said
    assert run([*command, "-o", "out", "--fresh"]) == ExitCode.OK
    said = capsys.readouterr().err
    assert "nested_shells, authored alpha: Budgets " in said
    assert "because the 2 views to measure hold " in said
    views = BenchResult.model_validate_json((folder / "out" / "bench.json").read_text()).views
    factors = [{cell.budget_factor for cell in view.cells} for view in views]
    loads = [view.fragments / (view.width * view.height) for view in views]
    assert factors == [set(default_budgets(loads))] * 2
    assert not any(cell.exact for view in views for cell in view.cells if cell.budget_factor == min(factors[0]))


def test_what_was_measured_is_not_measured_again(scene: Path, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    first = answer(capsys, str(scene), *FAST, "-o", "out", "-t", "kbuffer", "--budgets", "1")
    before = (folder / "out" / ROWS).read_text()
    assert answer(capsys, str(scene), *FAST, "-o", "out", "-t", "kbuffer", "--budgets", "1")["views"] == first["views"]
    assert (folder / "out" / ROWS).read_text() == before
    more = answer(capsys, str(scene), *FAST, "-o", "out", "-t", "kbuffer,moment", "--budgets", "1")
    assert more["views"][0]["cells"][0] == first["views"][0]["cells"][0]
    assert [cell["technique"] for cell in more["views"][0]["cells"]] == ["kbuffer", "moment"]
    added = json.loads((folder / "out" / ROWS).read_text().removeprefix(before))
    assert [cell["technique"] for cell in added["cells"]] == ["moment"]
    fresh = answer(capsys, str(scene), *FAST, "-o", "out", "-t", "moment", "--fresh")
    assert [cell["technique"] for cell in fresh["views"][0]["cells"]] == ["moment"]


def test_a_run_that_was_stopped_keeps_what_was_measured_and_the_next_goes_on(
    scene: Path, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    alphas = [f"0.{digit}" for digit in range(1, 8)]
    command = [str(scene), "--size", "48x32", "--repeats", "1", "--equal-fragments", "-t", "sbuffer"]
    command += ["--alpha", ",".join(alphas), "-o", "out"]
    kept: list[str] = []
    for sent, status in (
        (signal.SIGKILL, -signal.SIGKILL),
        (signal.SIGINT, ExitCode.INTERRUPTED),
        (signal.SIGTERM, ExitCode.INTERRUPTED),
    ):
        errors = stopped(["bench", *command, *(() if kept else ["--fresh"])], len(kept) + 1, sent, status)
        lines = (folder / "out" / ROWS).read_text().splitlines(keepends=True)
        assert [line for line in lines if line.endswith("\n")][: len(kept)] == kept, "nothing is measured twice"
        kept = [line for line in lines if line.endswith("\n")]
        if status == ExitCode.INTERRUPTED:
            (said,) = [line for line in errors if "error:" in line]
            assert said == "error: Stopped."
            assert errors[-1].startswith("Continue with: diaphane bench ")
            assert "--fresh" not in errors[-1]
        assert "Traceback" not in "".join(errors)
    result = BenchResult.model_validate(answer(capsys, *command))
    assert [view.alpha for view in result.views] == [float(alpha) for alpha in alphas]
    assert (folder / "out" / ROWS).read_text().splitlines(keepends=True)[: len(kept)] == kept


def stopped(arguments: list[str], views: int, sent: signal.Signals, status: int) -> list[str]:
    """Runs a command until so many views are measured, sends a signal then; the lines of its stderr."""
    code = f"from diaphane.cli import main; main({arguments!r})"
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    child = subprocess.Popen(
        [sys.executable, "-c", code],
        env=environment,
        stderr=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        text=True,
    )
    assert child.stderr is not None
    seen: list[str] = []
    for line in child.stderr:
        seen.append(line.rstrip("\n"))
        if "cells in" in line or "measured already" in line:
            views -= 1
            if views == 0:
                child.send_signal(sent)
    assert child.wait(timeout=20) == status, seen
    return seen


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (["missing.usda"], ExitCode.NOT_FOUND, "There is no scene missing.usda."),
        (["SCENE", "--budgets", "a"], ExitCode.USAGE, "--budgets has 'a', which is no number."),
        (["SCENE", "--views", ""], ExitCode.USAGE, ". is not a views file"),
        (["SCENE", "--camera", ""], ExitCode.NOT_FOUND, "has no camera ''"),
        (["SCENE", "-t", "magic"], ExitCode.NOT_FOUND, "There is no technique 'magic'."),
        (["SCENE", "-t", "kbuffer-deep"], ExitCode.USAGE, "kbuffer-deep needs a bundle."),
        (["SCENE", "--bundle", ".", "--g", "0.5"], ExitCode.USAGE, "the bundle brings its own, with its own g."),
        (["SCENE", "--bundle", "."], ExitCode.NOT_FOUND, ". is not a bundle"),
    ],
)
def test_bad_input_says_what_to_do(
    scene: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], code: ExitCode, words: str
) -> None:
    given = [str(scene) if argument == "SCENE" else argument for argument in arguments]
    assert run(["bench", *given, "-o", "out"]) == code
    assert words in capsys.readouterr().err


def test_a_scene_that_is_all_opaque_is_nothing_to_measure(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from pxr import Usd, UsdGeom

    stage = Usd.Stage.CreateNew(str(folder / "solid.usda"))
    UsdGeom.Cube.Define(stage, "/Cube")
    stage.Save()
    assert run(["bench", "solid.usda", "-o", "out"]) == ExitCode.NOT_FOUND
    assert "nothing in it is transparent" in capsys.readouterr().err


def test_the_suite_publishes_its_results_and_a_page(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (folder / "results").mkdir()
    monkeypatch.setattr(suite, "RESULTS", folder / "results")
    monkeypatch.setattr(suite, "PAGE", folder / "BENCH.md")
    monkeypatch.setattr(scenes, "SIZES", ((48, 32),))
    monkeypatch.setattr(suite, "TECHNIQUES", ("sbuffer", "kbuffer", "kbuffer-importance"))
    options = ["--work", "work", "--only", "nested_shells", "--size", "48x32", "--alpha", ".33,authored"]
    monkeypatch.setattr("sys.argv", ["suite", *options, "--repeats", "1", "--scenes", "nowhere"])
    assert suite.main() == 0
    page = (folder / "BENCH.md").read_text()
    for heading in (
        "How deep the scenes are",
        "Figure 6",
        "Table 1",
        "Table 2",
        "Score q",
        "Every technique",
        "Where each wins",
    ):
        assert f"### {heading}" in page
    (lines,) = (folder / "results").glob("bench-*.jsonl")
    result = suite.read_lines(lines)
    assert {(view.scene, view.alpha) for view in result.views} == {("nested_shells", 0.33), ("nested_shells", None)}
    assert [view.path_frames for view in result.views] == [0, PATH_FRAMES]
    for setting in ("authored", "alpha0.33"):
        assert (folder / "results" / f"{lines.stem}-figure6-{setting}-48x32-0.25.svg").is_file()
    assert str(folder) not in lines.read_text() + page
    # It goes on where it was: nothing is measured again.
    rows = (folder / "work" / suite.label() / ROWS).read_text()
    assert suite.main() == 0
    assert (folder / "work" / suite.label() / ROWS).read_text() == rows
    # So it does elsewhere from what is published, unless that is not wanted.
    options[1] = "elsewhere"
    monkeypatch.setattr("sys.argv", ["suite", *options, "--repeats", "1", "--scenes", "nowhere"])
    assert suite.main() == 0
    assert (folder / "elsewhere" / suite.label() / ROWS).read_text() == rows
    published = suite.PAGE.read_text()
    suite.PAGE.unlink()
    monkeypatch.setattr("sys.argv", ["suite", "--page-only"])
    assert suite.main() == 0
    assert suite.PAGE.read_text() == published


def test_exact_techniques_say_what_they_would_need_where_they_do_not_fit(
    scene: Path, folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(bands, "MOST_FRAGMENTS", 3)
    monkeypatch.setattr(exact_bytes, "LIMITS", replace(LIMITS, buffer_bytes=1000))
    command = [str(scene), *FAST, "-o", "out", "-t", "sbuffer,abuffer-array,kbuffer", "--budgets", ".01"]
    (view,) = answer(capsys, *command)["views"]
    cells = {cell["technique"]: cell for cell in view["cells"]}
    assert cells["abuffer-array"]["problem"].startswith("A pixel has")
    assert cells["abuffer-array"]["pool_bytes"] == 8 * view["most"] * 48 * 32
    assert cells["abuffer-array"]["total_bytes"] == cells["abuffer-array"]["pool_bytes"] + 4 * 48 * 32
    assert cells["sbuffer"]["pool_bytes"] == 8 * view["fragments"]
    assert cells["sbuffer"]["frame"]["median"] > 0.0, "in bands it is rendered all the same"
    assert [cells[name].get("fits", True) for name in ("abuffer-array", "sbuffer", "kbuffer")] == [False, False, True]
    assert run(["bench", *command]) == ExitCode.OK
    out = capsys.readouterr().out
    assert "A pixel has" in out
    assert f" KiB {UNFIT}" in out
    assert said_unfit() in out
    assert said_unfit() in (folder / "out" / "index.html").read_text()


def test_a_view_with_too_many_fragments_for_an_exact_picture_has_the_bytes_all_the_same(
    scene: Path, folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(capture, "LIMITS", replace(LIMITS, fragments=100))
    (view,) = answer(capsys, str(scene), *FAST, "-o", "out", "-t", "sbuffer,kbuffer", "--budgets", "1")["views"]
    assert view["fragments"] > 100
    exact, bounded = view["cells"]
    assert "the limit is 100" in exact["problem"]
    assert exact["pool_bytes"] == 8 * view["fragments"]
    assert "the limit is 100" in bounded["problem"]
    assert "total_bytes" not in bounded
    assert run(["bench", str(scene), *FAST, "-o", "out", "-t", "sbuffer,kbuffer", "--budgets", "1"]) == ExitCode.OK


def test_deep_scenes_are_a_group_that_is_measured_as_authored() -> None:
    assert {case.scene for case in cases_of(Path("nowhere"), Path(), only=[])} == set()
    cases = [Case(name, Path(name)) for name in ("bottles", "fur")]
    parts = list(parts_of(cases))
    assert [(part.alpha, part.size) for part in parts if part.case.scene == "fur"] == [(None, scenes.SIZES[0])]
    assert [part.case.scene for part in parts[:3]] == ["bottles", "fur", "bottles"]
    assert len(parts) == len(scenes.ALPHAS) * len(scenes.SIZES) + 1
    assert parts[0].measures("depth-peeling")
    assert not parts[1].measures("depth-peeling")
    assert parts[1].measures("abuffer-array")
    assert scenes.selected(["deep", "sponza"]) == {*DEEP, "sponza"}


def test_the_suites_bundle_was_trained_on_none_of_its_scenes() -> None:
    manifest = load_manifest(suite.BUNDLE)
    assert not {*SHARED, *SAMPLES, *DEEP} & set(manifest.provenance.scenes)
