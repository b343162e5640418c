"""`import diaphane`: what it offers, what it loads, and what its objects show."""

from __future__ import annotations

import base64
import io
import re
import subprocess
import sys
from html import escape
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from support import advice as stored
from support.measured import example

import diaphane
from diaphane import Advised, Fragments, allocate, building
from diaphane.local.options import BuildOptions
from diaphane.local.result import BuildResult
from evaluation.advice import run
from evaluation.advice.rules import advise as ruled
from evaluation.advice.words import sentences
from schemas.advice import Size
from schemas.measurement import RegistryResult
from schemas.problem import ExitCode, Problem

RGBA = np.array([[200, 40, 40, 128], [40, 200, 40, 128], [40, 40, 200, 128]], np.uint8)
ARRAYS = {"counts": np.array([[3, 0]]), "rgba": RGBA, "depth": [1.0, 2.0, 3.0]}


def test_every_name_is_there_and_documented() -> None:
    assert set(diaphane.__all__) <= set(dir(diaphane))
    assert all(getattr(diaphane, name).__doc__ for name in diaphane.__all__)
    with pytest.raises(AttributeError, match="no attribute 'close'"):
        _ = diaphane.close  # type: ignore[attr-defined]


def test_a_client_needs_neither_opengl_nor_numba() -> None:
    made = "import sys, diaphane; diaphane.Client('http://127.0.0.1:1')"
    code = f"{made}; print({{'moderngl', 'numba', 'torch', 'pxr'}} & set(sys.modules))"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60)
    assert found.stdout.strip() == "set()"


def test_allocations_know_the_shape_of_plain_arrays() -> None:
    found = allocate(ARRAYS, [1, 2], tail="density")
    assert found.shape == (1, 2)
    assert [one.k.tolist() for one in found] == [[1, 0], [2, 0]]
    html = found._repr_html_()
    assert html.count("<img") == 2
    picture = re.findall(r"base64,([^\"]+)", html)[1]
    pixels = np.asarray(Image.open(io.BytesIO(base64.b64decode(picture))))
    assert pixels.shape == (1, 2, 3)
    assert pixels[0, 0].sum() > pixels[0, 1].sum()


def test_fragments_are_the_arrays_of_the_dump() -> None:
    from labeller.api import fragments_of

    dump = fragments_of(ARRAYS)
    fragments = Fragments.of(dump)
    assert fragments.rgba is dump.rgba
    assert repr(fragments) == "<Fragments 2x1, 3 fragments, 1.50 per pixel, at most 3>"
    assert allocate(fragments, [1])[0].k.tolist() == allocate(dump, [1])[0].k.tolist()


def test_what_objects_show_is_text_and_not_markup() -> None:
    from diaphane.client import Record, Records

    one = Record(id="<script>", state="a & b", stages=[{}, {}])
    assert "<script>" not in one._repr_html_()
    assert "a &amp; b" in one._repr_html_()
    assert "2 items" in one._repr_html_()
    assert "&lt;script&gt;" in Records([one])._repr_html_()
    assert "kind" not in Records([one])._repr_html_()


def test_advice_shows_its_sentences_and_table(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = stored.scene(20.0, stored.sample("weighted-blended", 24.0, 1e-3))
    advice = ruled(scene, Size(width=64, height=64), 2**20)
    advice = advice.model_copy(update={"text": sentences(advice)})
    asked = []

    def advised(options: object, folder: Path | None) -> list[run.Advised]:
        asked.append(options)
        return [run.Advised(Path("a.usda"), advice, None)]

    monkeypatch.setattr(run, "advised", advised)
    (tmp_path / "a.usda").write_text("#usda 1.0\n")
    found = diaphane.advise(tmp_path / "a.usda", "1MiB", "64x64")
    assert isinstance(found, Advised)
    assert (asked[0].memory, str(asked[0].size)) == (2**20, "64x64")  # type: ignore[attr-defined]
    assert str(found) == "\n".join(advice.text)
    assert "weighted-blended" in found._repr_html_()
    found.save(tmp_path / "advice.html")
    assert "weighted-blended" in (tmp_path / "advice.html").read_text(encoding="utf-8")


def test_mistakes_are_problems(tmp_path: Path) -> None:
    with pytest.raises(Problem) as caught:
        diaphane.open(tmp_path / "nowhere.usda")
    assert caught.value.code is ExitCode.NOT_FOUND
    with pytest.raises(Problem, match="URL is not valid"):
        diaphane.Client("ftp://x")
    with pytest.raises(Problem, match="no scene"):
        diaphane.advise(tmp_path / "nowhere.usda")
    with pytest.raises(Problem, match="nowhere"):
        diaphane.build([tmp_path / "nowhere.usda"], "glass")


def test_a_build_is_asked_for_as_by_the_command_and_shows_what_it_proves(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("bottles.usda", "foliage.usda"):
        (tmp_path / name).write_text("#usda 1.0\n")
    scenes = [tmp_path / "bottles.usda", tmp_path / "foliage.usda"]
    asked: list[BuildOptions] = []

    def build(options: BuildOptions, progress: object) -> BuildResult:
        asked.append(options)
        published = RegistryResult(reference="glass@1.0.0", folder="f", champion=True, reason="It is the first.")
        return BuildResult(
            report=Path("report.html"),
            dataset=Path("datasets"),
            registry=published,
            licences="All allow it.",
            held_out=("bottles",),
            measurements=tuple(example()),
            skipped={},
            worked=True,
            seconds=1.0,
        )

    monkeypatch.setattr(building, "run", build)
    built = diaphane.build(scenes, "glass", holdout=scenes[:1], budgets=(1.0, 2.0), state=tmp_path, silent=True)
    assert asked[0].options.budgets == (1.0, 2.0)
    assert asked[0].training == (scenes[1],)
    assert built.registry.reference == "glass@1.0.0"
    shown = built._repr_html_()
    assert "bundle (kbuffer-deep)" in shown
    assert escape(built.verdict) in shown
    with pytest.raises(Problem, match="steps"):
        diaphane.build(scenes, "glass", steps=-1)
