"""The page of `benchmarks.three`."""

from __future__ import annotations

import json
from pathlib import Path

from benchmarks.three import SCENES, page

HOME = Path(__file__).resolve().parents[3] / "benchmarks"


def test_the_committed_page_is_that_of_the_committed_figures() -> None:
    found = json.loads((HOME / "results/three.json").read_text(encoding="utf-8"))
    assert page(found) == (HOME / "THREE.md").read_text(encoding="utf-8")
    assert found["scenes"].keys() == SCENES.keys()


def test_slots_for_all_fragments_make_the_right_picture() -> None:
    """Of every scene, where the device has them: 99.9 % of the pixels are within 2 of 255."""
    found = json.loads((HOME / "results/three.json").read_text(encoding="utf-8"))
    for name, scene in found["scenes"].items():
        for way in ("kbuffer, 8", "kbuffer-deep, 2"):
            assert scene["ways"][way]["within"] >= 0.999, (name, way)
