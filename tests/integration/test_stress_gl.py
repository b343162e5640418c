"""The GL part of `diaphane stress`, quick, on both software drivers."""

from __future__ import annotations

import pytest
from support.drivers import lavapipe_installed

from evaluation.stress import gl
from evaluation.stress.findings import Finding, NotRun, Options, Row
from evaluation.stress.gl_drivers import ZINK
from renderer.techniques import TECHNIQUES
from schemas.tail import BINNED_TAILS, TAILS

PASSES = (
    *("capture.bits", "range", "bins.kept", "bins.counts"),
    *("features", "features.kept", "predict.glsl", "allocation"),
    *("kbuffer-deep.F and K", "kbuffer-deep.overflowing network.F and K"),
)


@pytest.fixture(scope="module")
def rows() -> list[Row]:
    return list(gl.run(Options(quick=True)))


def test_every_pass_is_within_its_bound_on_every_driver(rows: list[Row]) -> None:
    assert [row for row in rows if not isinstance(row, NotRun) and not (isinstance(row, Finding) and row.ok)] == []


def test_every_technique_and_tail_is_there(rows: list[Row]) -> None:
    paths = {row.path for row in rows}
    for driver in ("llvmpipe", "zink") if lavapipe_installed() else ("llvmpipe",):
        for name, entry in TECHNIQUES.items():
            tails = BINNED_TAILS if entry.needs_bundle else TAILS
            expected = {f"{name}.{tail} · {driver}" for tail in tails} if entry.family == "bounded" else set()
            assert paths >= (expected or {f"{name} · {driver}"})
        assert paths >= {f"{path} · {driver}" for path in PASSES}
    cases = {row.case for row in rows if isinstance(row, Finding) and row.path == "sbuffer · llvmpipe"}
    assert cases == {"n up to 96", "n 4096"}


def test_a_driver_that_is_not_there_is_said(rows: list[Row]) -> None:
    assert ("gl · zink" in {row.path for row in rows if isinstance(row, NotRun)}) != lavapipe_installed()


def test_both_drivers_capture_the_same_bits(rows: list[Row]) -> None:
    if not lavapipe_installed():
        pytest.skip(f"there is no Vulkan driver for zink: apt-get install {ZINK.packages}")
    (agreed,) = (row for row in rows if row.path == "capture · llvmpipe = zink")
    assert isinstance(agreed, Finding)
    assert agreed.ok
