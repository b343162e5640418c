"""What an evaluation keeps of a picture: displayed, linear, and the k of every pixel, all of the same frame."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np

from evaluation.pictures import read_png
from labeller.curves import composite
from renderer.dump import write_dump
from renderer.exr import read_exr
from renderer.frame import Frame
from renderer.techniques import KBufferImportance
from schemas.colour import display8
from schemas.fragments import FragmentDump
from schemas.glass import DEFAULT_GLASS
from schemas.view import View
from stages.evaluate import EvaluateParams
from stages.shots import Session, Shot


def test_a_shot_keeps_the_picture_linear_and_displayed_and_its_counts(
    frame: Frame, dump: FragmentDump, tmp_path: Path
) -> None:
    write_dump(tmp_path, dump)
    params = EvaluateParams(
        view=View(name="front", eye=(0.0, 0.0, 5.0), target=(0.0, 0.0, 0.0), up=(0.0, 1.0, 0.0)),
        size=(dump.width, dump.height),
        alpha=None,
        glass=DEFAULT_GLASS,
        kind="baseline",
        budgets=(dump.pixels,),
        factors=(1.0,),
        tail="density-16",
        g=0.75,
    )
    desk = SimpleNamespace(
        frame=lambda *_: frame, artifact=lambda *_: tmp_path, compiled=lambda *_: {"kbuffer-importance", "sbuffer"}
    )
    session = Session(desk, SimpleNamespace(name="scene front"), params)  # type: ignore[arg-type]
    shots = tmp_path / "shots"
    shots.mkdir()
    shot = Shot(session, shots, 1.0, dump.pixels)
    assert shot.take(KBufferImportance()).skipped is None
    assert shot.take_exact().skipped is None
    for stem, counts in (("kbuffer-importance-1", None), ("exact", dump.counts)):
        linear, shown = read_exr(shots / f"{stem}.exr"), read_png(shots / f"{stem}.png")
        assert np.abs(display8(linear).astype(int) - shown.astype(int)).max() <= 1
        k = read_png(shots / f"{stem}.k.png").reshape(-1) if counts is None else counts
        simulated = composite(dump, k, "density-16", 0.75).reshape(linear.shape)
        np.testing.assert_allclose(linear, simulated, rtol=2e-3, atol=2e-3)
    assert read_png(shots / "sbuffer-1.k.png").reshape(-1).tolist() == dump.counts.tolist()
