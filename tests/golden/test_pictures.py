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

from renderer.context import describe
from renderer.frame import Frame
from renderer.gpu_scene import GpuScene
from renderer.techniques import Budget, KBuffer, KBufferImportance, SBuffer, Technique
from schemas.colour import display8

FOLDER = Path(__file__).parent
DRIVER = FOLDER / "driver.json"
SIZE = (240, 160)
TECHNIQUES: list[Technique] = [SBuffer(), KBuffer(), KBufferImportance()]


@pytest.fixture(scope="module")
def frame(gl: moderngl.Context) -> Frame:
    return Frame(GpuScene(gl, shells(subdivisions=3)), VIEW, *SIZE)


@pytest.mark.parametrize("technique", TECHNIQUES, ids=lambda technique: technique.name)
def test_picture_is_the_golden_one(
    technique: Technique, frame: Frame, gl: moderngl.Context, request: pytest.FixtureRequest, tmp_path: Path
) -> None:
    picture = display8(technique.render(frame, Budget(2 * frame.pixels)).linear)
    golden_file = FOLDER / f"{technique.name}.png"
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
