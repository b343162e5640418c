"""The notebook runs as it is, and what is kept in it is what it shows."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.notebook import run

NOTEBOOK = Path(__file__).resolve().parents[2] / "docs" / "notebook.ipynb"
_NUMBER = re.compile(r"[\d.,]*\d(?:e-?\d+)?|base64,[^\"]*")


def shown(notebook: dict[str, Any]) -> list[Any]:
    """What each cell shows, without numbers and pixels, which drivers and clocks have a say in."""
    texts = []
    for cell in notebook["cells"]:
        for output in cell.get("outputs", ()):
            parts = output["data"] if "data" in output else {output["name"]: output["text"]}
            texts.append({kind: _NUMBER.sub("#", "".join(lines)) for kind, lines in parts.items()})
    return texts


def test_the_notebook_runs_and_shows_what_it_keeps(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    kept = json.loads(NOTEBOOK.read_text(encoding="utf-8"))
    made = json.loads(NOTEBOOK.read_text(encoding="utf-8"))
    names = run(made)
    assert shown(made) == shown(kept), "run `PYTHONPATH=.:tests python -m support.notebook docs/notebook.ipynb`"
    assert sum("<img" in str(texts.get("text/html")) for texts in shown(kept)) >= 5
    exact, fragments = names["exact"], names["fragments"]
    assert np.asarray(exact).shape == (fragments.height, fragments.width, 3)
    assert exact.cost.fragments == fragments.total
    assert 0.0 < names["optimal"].cost.mse < names["fixed"].cost.mse
    for best, other in zip(names["found"], names["greedy"], strict=True):
        assert best.used <= best.budget
        assert best.bound is not None
        assert best.bound <= best.error <= other.error
