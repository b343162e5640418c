"""The benchmark of predictors runs on the project's own scenes, and does nothing twice."""

from __future__ import annotations

import json
from pathlib import Path
from xml.etree import ElementTree

import moderngl
import pytest

from benchmarks import predictors
from benchmarks.casting.cases import sample_cases
from benchmarks.predicting import training, views
from benchmarks.predicting.labels import OPTIMUM
from benchmarks.predicting.variants import Variant
from schemas.network import NetworkSize
from schemas.tail import TailName
from trainer.config import TrainConfig

SHORT = {"steps": 30, "validate_every": 30, "hidden": (4,)}


def _variant(size: NetworkSize, tail: TailName) -> Variant:
    return Variant(size, tail, TrainConfig.sized(size, **SHORT))


FEW = {
    variant.name: variant
    for variant in (_variant("tiny", "binned-12"), _variant("small", "binned-12"), _variant("small", "density-16"))
}


@pytest.fixture(scope="module")
def folder(gl: moderngl.Context, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("predictors")


@pytest.fixture(autouse=True)
def few(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(predictors, "variants", lambda: FEW)
    monkeypatch.setattr(views, "sample_cases", lambda folder: sample_cases(folder)[:6])


def _arguments(folder: Path, *more: str) -> list[str]:
    outputs = ["--out", str(folder / "p.json"), "--page", str(folder / "P.md")]
    return ["--work", str(folder), "--size", "32x24", "--views", "1", "--folds", "2", *outputs, *more]


def test_it_runs_and_does_nothing_twice(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert predictors.main(_arguments(folder)) == 0
    found = json.loads((folder / "p.json").read_text())
    assert set(found["variants"]) == set(FEW)
    assert 0 < found["setting"]["scored"] < found["setting"]["views"], "some views are trained on alone"
    for row in found["variants"].values():
        # Every asset is held out once, and the certified optimum is not beaten.
        assert len(row["assets"]) == found["setting"]["assets"] > 4
        ratios = [value for values in row["of optimum"].values() for value in values if value is not None]
        assert ratios
        assert min(ratios) >= 1.0 - 1e-6
        assert 0 <= row["worse"] <= row["cells"]
    assert {row["rule"] for row in found["rules"]} > {OPTIMUM, "importance"}
    page = (folder / "P.md").read_text()
    assert all(f"| {name} |" in page for name in FEW)
    for plot in folder.glob("*.svg"):
        ElementTree.fromstring(plot.read_text())
    assert len(list(folder.glob("*.svg"))) == 2

    def refuse(*_: object, **__: object) -> None:
        raise AssertionError("trained again")

    monkeypatch.setattr(training, "train", refuse)
    before = page
    assert predictors.main(_arguments(folder)) == 0
    (folder / "P.md").unlink()
    assert predictors.main(["--page-only", "--out", str(folder / "p.json"), "--page", str(folder / "P.md")]) == 0
    after = (folder / "P.md").read_text()
    assert [line for line in after.splitlines() if line.startswith("|")] == [
        line for line in before.splitlines() if line.startswith("|")
    ]


def test_unknown_variants_are_refused(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        predictors.main(_arguments(folder, "--variants", "nothing"))
    assert "there are tiny, binned-12" in capsys.readouterr().err
