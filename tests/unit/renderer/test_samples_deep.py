"""The deep sample scenes: same bytes every time, small files, as deep as they are for, transparent as authored."""

from __future__ import annotations

import re
from itertools import pairwise
from pathlib import Path

import moderngl
import numpy as np
import pytest
from pxr import Usd

from renderer.frame import Frame
from renderer.gpu_scene import GpuScene
from renderer.samples import SAMPLES, write_samples
from renderer.samples.deep import DEEP
from renderer.scene import load_scene
from schemas.scene import SceneArrays

pytestmark = pytest.mark.dear

DEPTHS = {
    "anatomy": 8.7,
    "fur": 8.6,
    "fountain": 10.6,
    "turbofan": 12.4,
    "marbles": 13.9,
    "hedge": 17.9,
    "long_hair": 26.8,
    "galaxy": 33.1,
    "smoke_plume": 51.5,
    "cloudscape": 91.9,
}
"""Transparent fragments per pixel of the first camera at 1430x960."""
SIZE = (143, 96)
DOCUMENT = Path(__file__).resolve().parents[3] / "docs" / "SAMPLES.md"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("deep")
    write_samples(place, DEEP)
    return place


@pytest.fixture(scope="module")
def scenes(folder: Path) -> dict[str, SceneArrays]:
    return {name: load_scene(folder / f"{name}.usdc") for name in DEEP}


def test_there_are_at_least_eight_and_none_is_one_of_the_small_ones() -> None:
    assert len(DEEP) >= 8
    assert not DEEP.keys() & SAMPLES.keys()


def test_bytes_are_the_same_every_time(folder: Path, tmp_path: Path) -> None:
    write_samples(tmp_path, DEEP)
    ours = {p.relative_to(tmp_path): p.read_bytes() for p in tmp_path.rglob("*.*")}
    theirs = {p.relative_to(folder): p.read_bytes() for p in folder.rglob("*.*")}
    assert ours == theirs


def test_files_are_small(folder: Path) -> None:
    sizes = {p.name: p.stat().st_size for p in folder.rglob("*.*")}
    assert max(sizes.values()) < 4_000_000, sizes
    assert sum(sizes.values()) < 20_000_000, sizes


@pytest.mark.parametrize("name", DEEP)
def test_it_is_transparent_as_authored_and_loads_without_warnings(scenes: dict[str, SceneArrays], name: str) -> None:
    scene = scenes[name]
    assert scene.warnings == ()
    assert not scene.is_opaque
    assert len(scene.cameras) == 3
    assert scene.triangles <= 2_500_000
    assert any(batch.layer == "opaque" for batch in scene.batches)


@pytest.mark.parametrize("name", DEEP)
def test_it_is_as_deep_as_listed(ctx: moderngl.Context, scenes: dict[str, SceneArrays], name: str) -> None:
    scene = scenes[name]
    counts = Frame(GpuScene(ctx, scene), scene.cameras[0], *SIZE).count()
    # Textures have coarser levels in a small picture, in which what is not empty reaches further.
    assert 0.95 < counts.mean() / DEPTHS[name] < 1.35
    # A budget can be spent where it counts: some pixels are far deeper than others.
    assert counts.max() > 2.0 * counts.mean()
    assert np.mean(counts < 0.5 * counts.mean()) > 0.1


def test_they_spread_from_8_to_100_fragments_a_pixel() -> None:
    assert DEPTHS.keys() == DEEP.keys()
    depths = sorted(DEPTHS.values())
    assert depths[0] >= 8.0
    assert 80.0 < depths[-1] <= 100.0
    assert max(b / a for a, b in pairwise(depths)) < 2.0


def test_the_document_lists_every_scene_and_how_deep_it_is() -> None:
    rows = re.findall(r"^\| `(\w+)` \| ([\d.]+) \|", DOCUMENT.read_text(encoding="utf-8"), re.MULTILINE)
    assert {name: float(depth) for name, depth in rows} == DEPTHS
    assert all(f"| `{name}` |" in DOCUMENT.read_text(encoding="utf-8") for name in SAMPLES)


def test_they_are_of_cards_curves_points_shells_and_instances(folder: Path, scenes: dict[str, SceneArrays]) -> None:
    stages = [Usd.Stage.Open(str(folder / f"{name}.usdc")) for name in DEEP]
    kinds = {prim.GetTypeName() for stage in stages for prim in stage.Traverse()}
    assert {"Mesh", "BasisCurves", "Points", "PointInstancer"} <= kinds
    hedge = scenes["hedge"].batches
    assert any(b.opacity_threshold > 0 for b in hedge)
    assert any(b.layer == "mixed" and b.opacity_threshold == 0 for b in hedge)
