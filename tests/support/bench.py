"""Made-up results of a benchmark."""

from __future__ import annotations

from typing import Any

from renderer.techniques import TECHNIQUES
from schemas.bench import BenchCell, BenchView, Times, Yardstick
from schemas.tail import DEFAULT_TAIL, DENSITY_G


def cell(technique: str = "kbuffer", factor: float | None = 2.0, **values: Any) -> BenchCell:
    """A cell; bounded techniques have the default tail."""
    family = TECHNIQUES[technique].family
    bounded = {"basis": "fragments", "budget_factor": factor, "tail": DEFAULT_TAIL, "g": DENSITY_G, "budget": 200}
    about: dict[str, Any] = bounded if family == "bounded" else {"basis": "none"}
    error = 0.0 if family == "exact" else 1e-4
    times = Times(median=10.0, least=9.0, most=12.0)
    given: dict[str, Any] = {
        "repeats": 3,
        "passes": {"opaque": Times(median=1.0, least=1.0, most=2.0), "resolve": times},
        "frame": times,
        "mse": error,
        "mse_display": error,
        "mse_linear": error,
        "mse_occupied": error,
        "psnr": None if family == "exact" else 40.0,
        "ssim": 0.99,
        "flip": 0.01,
        "k_min": 0,
        "k_max": 4,
        "captured_fragments": 150,
        "pool_bytes": 1600,
        "pixel_bytes": 64,
        "total_bytes": 8000,
        **values,
    }
    return BenchCell(technique=technique, family=family, **{**about, **given})


def view(*cells: BenchCell, key: str = "a", **values: Any) -> BenchView:
    """A view with 400 fragments."""
    oracle = {"tail": "weighted-average", "g": None, "gap": None, "rule": "greedy"}
    optimum = {"tail": DEFAULT_TAIL, "g": DENSITY_G, "gap": 1e-6, "rule": "optimal"}
    common = {"budget_factor": 2.0, "budget": 200, "mse_display": 1e-5, "k_min": 0, "k_max": 9}
    marks = [
        Yardstick(**rule, **common, mse=mse, captured_fragments=200) for rule, mse in ((oracle, 2e-5), (optimum, 1e-5))
    ]
    given: dict[str, Any] = {
        "key": key,
        "scene": "panes",
        "view": "front",
        "alpha": 0.33,
        "width": 10,
        "height": 10,
        "triangles": 2,
        "fragments": 400,
        "occupied": 90,
        "most": 12,
        "path_frames": 0,
        "yardsticks": tuple(marks),
        "driver": "llvmpipe",
        "clock": "host clock",
        "machine": {"processor": "some", "cores": "2"},
        "commit": "abc",
        "code": "def",
        "created": "2026-01-01T00:00:00+00:00",
        "seconds": 1.0,
        "load": (0.1, 0.2),
        **values,
    }
    return BenchView(cells=tuple(cells), **given)
