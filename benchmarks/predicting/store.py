"""What the benchmark has worked out already: files in one folder, named by everything that decided them."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

from evaluation.versions import code_version

_KEY: Final = 20
"""Hex digits of a key."""


def _here(*modules: str) -> tuple[str, ...]:
    return tuple(f"benchmarks.predicting.{module}" for module in modules)


_LABELLER: Final = tuple(
    f"labeller.{name}"
    for name in (
        *("allocation", "baselines", "core_problem", "curve_kernels", "curves", "descent", "error_rules", "greedy"),
        *("hull", "numerics", "optimal", "rules", "selection", "skips"),
    )
)

CODE: Final = {
    "dumps": ("renderer.opacities", *_here("views")),
    "labels": (
        *_LABELLER,
        *(f"labeller.{name}" for name in ("columns", "sampling", "shard_file", "shards")),
        *(f"renderer.{name}" for name in ("features", "depth_bins", "tile_range")),
        *(f"renderer.allocation.{name}" for name in ("dynamic", "fill", "importance")),
        *("schemas.tail", "schemas.colour"),
        *_here("labels"),
    ),
    # Settings of a training are in its key themselves.
    "training": (
        *(f"trainer.{name}" for name in ("adam", "dataset", "evaluate", "heads", "loss", "models")),
        *(f"trainer.{name}" for name in ("segments", "sgd", "train", "views", "weights")),
        *_here("training"),
    ),
    "scores": ("trainer.weights", "renderer.allocation.cuts", "renderer.features", *_here("cuts", "scoring")),
}
"""Sources that decide a kind of result: one of them changed, it is worked out again."""


def key_of(*parts: Any) -> str:
    """A short name for values that JSON can hold."""
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()[:_KEY]


class Store:
    """Results on disk. One process at a time writes to it; a stopped one leaves whole files only.

    Args:
        folder: Made if it is not there.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        # At once: sources that are edited later are not those that are running.
        self._code = {kind: code_version(*sources) for kind, sources in CODE.items()}

    def code(self, kind: str) -> str:
        """Version of the sources of a kind, those of `CODE`."""
        return self._code[kind]

    def path(self, kind: str, name: str) -> Path:
        """Where a file of a kind lies; its folder is there."""
        path = self.folder / kind / name
        path.parent.mkdir(parents=True, exist_ok=True)
        return path

    def remember(self, kind: str, key: str, make: Callable[[], Any]) -> Any:
        """What JSON of that key holds; made, and written, where there is none."""
        path = self.path(kind, f"{key}.json")
        if not path.exists():
            made = make()
            self.write(path, lambda part: part.write_text(json.dumps(made), encoding="utf-8"))
        return json.loads(path.read_text(encoding="utf-8"))

    @staticmethod
    def write(path: Path, write: Callable[[Path], Any]) -> None:
        """Write a file so that it is there as a whole or not at all.

        Args:
            path: The file.
            write: Writes to the path that it gets, which has the same suffix.
        """
        part = path.with_name(f".{path.name}.part{path.suffix}")
        write(part)
        part.replace(path)
