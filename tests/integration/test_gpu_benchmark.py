"""`make bench-gpu` in its smallest form, on the software driver: what it writes, leaves out, and notices."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import moderngl
import numpy as np
import pytest

from benchmarks import gpu
from benchmarks.comparing.scenes import SHARED
from benchmarks.graphics.checking import compared
from benchmarks.graphics.plan import PLAN, planned
from renderer.frame import Frame
from renderer.samples import SAMPLES
from renderer.samples.deep import DEEP
from renderer.techniques import Budget, Rendered, WeightedAverage
from schemas.bench import BenchCell
from schemas.problem import ExitCode

TINY = ["--only", "bottles", "--size", "48x32", "--repeats", "1", "--no-account", "--software", "--budgets", ".5"]
TECHNIQUES = ["--techniques", "sbuffer,kbuffer,weighted-average,depth-peeling"]


@pytest.fixture(autouse=True)
def small_checks(gl: moderngl.Context, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gpu, "CHECK_SIZE", (48, 32))


def results(path: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(path.read_text())
    return found


def test_a_software_rasteriser_is_refused_with_what_to_do(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert gpu.main(["--out", str(tmp_path / "out.json")]) == ExitCode.CHECK_FAILED
    said = capsys.readouterr().err
    assert "a software rasteriser" in said
    assert "--software" in said
    assert not (tmp_path / "out.json").exists()


def test_it_writes_one_file_with_times_errors_and_checks(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "results" / "gpu.json"
    assert gpu.main([*TINY, *TECHNIQUES, "--out", str(out)]) == 0
    assert capsys.readouterr().out == f"{out}\n"
    found = results(out)
    assert {"created", "command", "machine", "versions", "commit", "driver", "load_average", "bundle"} <= found.keys()
    assert not found["is_graphics_card"]
    assert found["left_out"] == []
    (row,) = found["scenes"]
    assert (row["scene"], row["alpha"], row["width"], row["height"]) == ("bottles", None, 48, 32)
    assert row["fragments"] >= row["occupied"] >= row["most"] > 0
    cells = {cell.technique: cell for cell in map(BenchCell.model_validate, row["cells"])}
    assert list(cells) == ["sbuffer", "kbuffer", "weighted-average", "depth-peeling"]
    assert all(cell.repeats == 1 and cell.frame is not None and cell.passes for cell in cells.values())
    assert cells["sbuffer"].mse == cells["depth-peeling"].mse == 0.0
    assert cells["weighted-average"].mse or 0.0 > 0.0
    assert cells["kbuffer"].budget == 48 * 32 // 2
    assert [check["technique"] for check in row["checks"]] == list(cells)
    assert all(check["is_right"] and check["compared"] > 100 for check in row["checks"])


def test_a_wrong_picture_is_seen_and_the_file_is_there_all_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    kept = WeightedAverage.render

    def wrong(self: WeightedAverage, frame: Frame, budget: Budget) -> Rendered:
        found = kept(self, frame, budget)
        return replace(found, linear=found.linear + np.float32(2e-3))

    def broken(*_: object) -> Rendered:
        raise moderngl.Error("0:7: no such function")

    monkeypatch.setattr(WeightedAverage, "render", wrong)
    monkeypatch.setattr("renderer.techniques.moment.Moment.render", broken)
    out = tmp_path / "gpu.json"
    names = ["--techniques", "sbuffer,weighted-average,moment"]
    assert gpu.main([*TINY, *names, "--out", str(out)]) == ExitCode.CHECK_FAILED
    said = capsys.readouterr().err
    assert "WRONG: weighted-average: " in said
    assert "WRONG: moment: 0:7: no such function" in said
    (row,) = results(out)["scenes"]
    assert [check["is_right"] for check in row["checks"]] == [True, False, False]
    assert [cell.get("problem") for cell in row["cells"]] == [None, "0:7: no such function", None]


def test_what_the_time_does_not_hold_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "gpu.json"
    assert gpu.main([*TINY, *TECHNIQUES, "--minutes", "0", "--out", str(out)]) == ExitCode.NOT_FOUND
    assert results(out)["left_out"] == ["bottles, authored alpha: no time was left."]
    clock = iter([0.0, 1.0, *[100.0] * 100])  # the scene is begun in time, and its cells are not
    monkeypatch.setattr(gpu.time, "monotonic", lambda: next(clock))
    assert gpu.main([*TINY, *TECHNIQUES, "--minutes", "1", "--out", str(out)]) == 0
    (said,) = results(out)["left_out"]
    assert said.startswith("bottles, authored alpha: without sbuffer, kbuffer at F = 0.5 WH, weighted-average")
    assert "left out: bottles" in capsys.readouterr().err


def test_work_is_counted_where_there_is_time(tmp_path: Path) -> None:
    out = tmp_path / "gpu.json"
    command = [word for word in TINY if word != "--no-account"]
    assert gpu.main([*command, "--techniques", "weighted-average", "--out", str(out)]) == 0
    (row,) = results(out)["scenes"]
    (cell,) = map(BenchCell.model_validate, row["cells"])
    assert cell.work["sums"].geometry_passes == 1
    assert cell.work["sums"].blended_bytes == 40 * row["fragments"]


def test_scenes_that_are_not_there_are_named_and_all_others_are_known(tmp_path: Path) -> None:
    assert {name for name, _ in PLAN} <= {*SAMPLES, *DEEP, *SHARED}
    assert [each.case.scene for each in planned(tmp_path, tmp_path, ["bottles", "sponza"])] == ["bottles"]
    (deep,) = planned(tmp_path, tmp_path, ["marbles"])
    assert deep.techniques()[:3] == ["kbuffer-deep", "binned", "sbuffer"]
    assert "depth-peeling" not in deep.techniques()


def test_what_is_no_number_is_off() -> None:
    linear = np.zeros((4, 3), np.float32)
    linear[1] = np.nan
    assert compared("sbuffer", linear, np.zeros((4, 3))).off == 1
    assert not compared("sbuffer", linear, np.zeros((4, 3))).is_right
