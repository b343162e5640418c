"""Pictures that must not change: identical on the driver they were made with, within 2/255 nearly everywhere on others.

`python -m pytest tests/golden --golden` writes them anew; look at them before they are committed.
"""

from __future__ import annotations

import json
from pathlib import Path

import moderngl
import numpy as np
import pytest
from PIL import Image
from support.scenes import VIEW, shells
from support.training import export_random, random_weights

from renderer.capture import capture
from renderer.context import describe
from renderer.features import derive, gather
from renderer.frame import Frame
from renderer.gpu_scene import GpuScene
from renderer.techniques import TECHNIQUES, Budget, Needs, technique
from schemas.colour import display8
from schemas.tail import DEFAULT_TAIL

FOLDER = Path(__file__).parent
DRIVER = FOLDER / "driver.json"
SIZE = (240, 160)


@pytest.fixture(scope="module")
def frame(gl: moderngl.Context) -> Frame:
    return Frame(GpuScene(gl, shells(subdivisions=3)), VIEW, *SIZE)


@pytest.fixture(scope="module")
def needs(frame: Frame, tmp_path_factory: pytest.TempPathFactory) -> Needs:
    """A network of random weights, and an allocation that depends on nothing but the counts."""
    folder = tmp_path_factory.mktemp("bundle")
    dump = capture(frame).dump
    export_random(folder, random_weights(11, hidden=(32, 16)), derive(gather(dump, DEFAULT_TAIL))[dump.counts > 0])
    return Needs(bundle=folder, allocate=lambda frame, _: (frame.count() // 2).astype(np.int32))


@pytest.mark.parametrize("name", TECHNIQUES)
def test_picture_is_the_golden_one(
    name: str, needs: Needs, frame: Frame, gl: moderngl.Context, request: pytest.FixtureRequest, tmp_path: Path
) -> None:
    made = technique(name, needs)
    for _ in range(TECHNIQUES[name].settles):
        picture = display8(made.render(frame, Budget(2 * frame.pixels)).linear)
    golden_file = FOLDER / f"{name}.png"
    if request.config.getoption("--golden"):
        Image.fromarray(picture).save(golden_file, optimize=True)
        DRIVER.write_text(json.dumps({"driver": describe(gl)}) + "\n", encoding="utf-8")
    with Image.open(golden_file) as image:
        golden = np.asarray(image)
    difference = np.abs(picture.astype(int) - golden.astype(int)).max(axis=2)
    if difference.any():
        Image.fromarray(picture).save(tmp_path / golden_file.name)
    same_driver = json.loads(DRIVER.read_text(encoding="utf-8"))["driver"] == describe(gl)
    if same_driver:
        assert difference.max() == 0, f"{int((difference > 0).sum())} pixels differ: see {tmp_path}"
    else:  # another driver may sample edges elsewhere
        assert (difference <= 2).mean() > 0.995, f"see {tmp_path}"
