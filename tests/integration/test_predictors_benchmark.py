"""The benchmark of predictors runs on the project's own scenes, and does nothing twice."""

from __future__ import annotations

import json
from pathlib import Path
from xml.etree import ElementTree

import moderngl
import pytest

from benchmarks import predictors
from benchmarks.predicting import learned_scores, learned_tail, summary, training, variants, weighted
from benchmarks.predicting.variants import Variant
from trainer.config import TrainConfig

SHORT = TrainConfig(steps=30, validate_every=30, hidden=(4,))
FEW = {
    "density-16": Variant("density-16", "variants", "density-16", SHORT, base=""),
    "feedback": Variant("feedback", "inputs", "density-16", SHORT, feedback="colour", turns=1, base="density-16"),
    "paper-repaired": Variant(
        "paper-repaired", "presets", "density-8", TrainConfig.of("paper-repaired", steps=5, validate_every=5)
    ),
    "around": Variant("around", "inputs", "density-8", SHORT, inputs="neighbourhood"),
    "opacities": Variant("opacities", "augmentation", "density-16", SHORT, augmentation="opacities"),
    "colours": Variant("colours", "augmentation", "density-16", SHORT, augmentation="colours"),
    "cuts": Variant("cuts", "augmentation", "density-16", SHORT, augmentation="cuts"),
    "half": Variant("half", "inputs", "density-16", SHORT, inputs="half-resolution"),
    "weights": Variant("weights", "losses", "density-16", SHORT, weights="flip"),
    "factor": Variant("factor", "tails", "density", SHORT, learned="factor", base="density-16"),
    "exponents": Variant("exponents", "tails", "density-16", SHORT, learned="exponents"),
    "coverage": Variant("coverage", "tails", "density-16", SHORT, learned="coverage"),
    "distilled": Variant("distilled", "losses", "density-16", SHORT, teacher="density-16", teaching=0.5),
}


@pytest.fixture(scope="module")
def folder(gl: moderngl.Context, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("predictors")


@pytest.fixture(autouse=True)
def few(monkeypatch: pytest.MonkeyPatch) -> None:
    for module in (predictors, variants, training, summary, weighted, learned_scores):
        monkeypatch.setattr(module, "variants", lambda: FEW)
    monkeypatch.setattr(learned_tail, "STEPS", 20)


def _arguments(folder: Path, *more: str) -> list[str]:
    outputs = ["--out", str(folder / "p.json"), "--page", str(folder / "P.md")]
    return ["--work", str(folder), "--size", "48x36", "--views", "1", "--folds", "2", *outputs, *more]


def test_it_runs_and_does_nothing_twice(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert predictors.main(_arguments(folder)) == 0
    found = json.loads((folder / "p.json").read_text())
    assert set(found["variants"]) == set(FEW)
    every = found["variants"]["density-16"]
    assert every["q"][0] > 0.0
    # Every asset is held out once, and the certified optimum is not beaten.
    assert len(every["assets"]) == found["setting"]["assets"] > 4
    assert all(value is None or value >= 1.0 - 1e-6 for value in every["of optimum"])
    assert found["variants"]["feedback"]["q"] != every["q"]
    assert all(found["variants"][name]["of optimum"][0] >= 1.0 - 1e-6 for name in ("weights", "factor", "exponents"))
    assert "mean FLIP over that of" in (folder / "P.md").read_text()
    oracle = next(r for r in found["rules"] if (r["tail"], r["rule"]) == ("weighted-average", "greedy"))
    assert all(value is None or value == pytest.approx(1.0) for value in oracle["q"])
    assert len(found["tails"]) > 10
    assert "| density-16 |" in (folder / "P.md").read_text()
    for plot in folder.glob("*.svg"):
        ElementTree.fromstring(plot.read_text())
    assert len(list(folder.glob("*.svg"))) == 2

    def refuse(*_: object, **__: object) -> None:
        raise AssertionError("trained again")

    monkeypatch.setattr(training, "train", refuse)
    before = (folder / "P.md").read_text()
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
    assert "there are density-16" in capsys.readouterr().err
