"""One USD layer, read without a stage: every file that it names anywhere, and what would compose it.

Reading a layer opens no other file. Values are looked at by what they are, not by what their attribute's type says: a
crate can hold a file name where its attribute says float.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

from pxr import Sdf

from renderer.gate.names import check_reference, split_package
from renderer.gate.problems import RejectedScene, shown
from schemas.limits import LIMITS

MAX_SPECS = 16 * LIMITS.prims
"""Prims, properties and variants of one layer as written."""
MAX_VALUE_DEPTH = 32
"""Dictionaries in each other."""

PLAIN_FIELDS = frozenset(("subLayerOffsets",))
"""Fields that have no value in Python, and no files."""
ARC_FIELDS = ("references", "payload")
CLIP_TIMES = {
    f"{prefix}{name}": name.lower()
    for prefix in ("template", "clipTemplate")
    for name in ("StartTime", "EndTime", "Stride")
}
"""Fields of value clips that are named by templates."""
CLIP_ARRAYS = ("active", "times", "assetPaths")
COMPOSING = frozenset(("references", "payload", "inheritPaths", "specializes", "variantSetNames"))
"""Fields of a prim that bring in what is elsewhere."""


@dataclass
class LayerContent:
    """What the gate knows of a layer.

    Attributes:
        name: Relative name, `package.usdz[member]` in a package.
        layer: The layer, kept so that a stage need not read it again.
        arcs: Files that are composed: sublayers, references, payloads, value clips; as authored, cleaned.
        assets: Other files that are named.
        clip_times: Of value clips that are named by templates: start, end and stride, each as often as it is written.
        composing: Prims, and variants of prims, with fields that bring in what is elsewhere.
    """

    name: str
    layer: Sdf.Layer
    arcs: set[str] = field(default_factory=set)
    assets: set[str] = field(default_factory=set)
    clip_times: dict[str, list[float]] = field(default_factory=dict)
    composing: set[Sdf.Path] = field(default_factory=set)


def read_layer(name: str, layer: Sdf.Layer) -> LayerContent:
    """Everything that a layer names.

    Args:
        name: Its relative name, for messages.
        layer: The layer.

    Raises:
        RejectedScene: It names something outside the upload, uses expressions, or has too much in it.
    """
    reader = _LayerReader(LayerContent(name, layer))
    paths: list[Sdf.Path] = []

    def collect(path: Sdf.Path) -> None:
        if len(paths) >= MAX_SPECS:
            raise RejectedScene("scene-too-large", f"{shown(name)} has more than {MAX_SPECS} prims and properties.")
        paths.append(path)

    layer.Traverse(Sdf.Path.absoluteRootPath, collect)
    for path in paths:
        reader.read(path)
    return reader.content


class _LayerReader:
    def __init__(self, content: LayerContent) -> None:
        self.content = content
        self._shown = shown(content.name)
        self._depth = 0 if split_package(content.name)[1] is not None else content.name.count("/")

    def read(self, path: Sdf.Path) -> None:
        """Looks at every field of the spec at a path."""
        spec = self.content.layer.GetObjectAtPath(path)
        if spec is None:
            return
        keys = spec.ListInfoKeys()
        if not path.IsPropertyPath() and not COMPOSING.isdisjoint(keys):
            self.content.composing.add(path)
        for key in keys:
            if key == "timeSamples":
                for time in self.content.layer.ListTimeSamplesForPath(path):
                    self._assets(self.content.layer.QueryTimeSample(path, time), 0)
            elif key not in PLAIN_FIELDS:
                self._field(key, spec.GetInfo(key))

    def _field(self, key: str, value: Any) -> None:
        if key == "expressionVariables" and value:
            raise RejectedScene("scene-expression", f"{self._shown} has expression variables.")
        if key == "subLayers":
            self.content.arcs.update(self._checked(str(path)) for path in value)
        elif key in ARC_FIELDS:
            for item in _items(value):
                if item.assetPath:
                    self.content.arcs.add(self._checked(item.assetPath))
                self._assets(getattr(item, "customData", None), 0)
        elif key in ("clips", "clipTemplateAssetPath"):
            self._clips(value, 0)
        elif key in CLIP_TIMES:
            self._clip_time(key, value)
        elif key == "variantSelection":
            if any("`" in str(choice) for choice in dict(value).values()):
                raise RejectedScene("scene-expression", f"{self._shown} selects a variant by an expression.")
        else:
            self._assets(value, 0)

    def _assets(self, value: Any, depth: int) -> None:
        """Notes every asset path in a value."""
        for path in self._paths(value, depth):
            self.content.assets.add(self._checked(path))

    def _clips(self, value: Any, depth: int) -> None:
        """Value clips name layers by asset paths, and by templates that are plain strings."""
        self.content.arcs.update(self._checked(path) for path in self._paths(value, depth))
        if isinstance(value, str):
            self.content.arcs.add(self._checked(value.replace("#", "0")))
        elif isinstance(value, dict):
            for key, item in value.items():
                if isinstance(item, dict) or key == "templateAssetPath":
                    self._clips(item, depth + 1)
                elif key in CLIP_TIMES:
                    self._clip_time(key, item)
                elif key in CLIP_ARRAYS and hasattr(item, "__len__") and len(item) > LIMITS.clip_steps:
                    raise RejectedScene("scene-too-large", f"{self._shown} has value clips of too many steps.")

    def _clip_time(self, key: str, value: Any) -> None:
        if isinstance(value, int | float):
            self.content.clip_times.setdefault(CLIP_TIMES[key], []).append(float(value))

    def _paths(self, value: Any, depth: int) -> Iterator[str]:
        if depth > MAX_VALUE_DEPTH:
            raise RejectedScene("scene-too-large", f"{self._shown} has dictionaries too deep in each other.")
        if isinstance(value, Sdf.AssetPath):
            if value.path:
                yield value.path
        elif isinstance(value, Sdf.AssetPathArray):
            yield from (item.path for item in value if item.path)
        elif isinstance(value, dict):
            for item in value.values():
                yield from self._paths(item, depth + 1)
        elif isinstance(value, Sdf.UnregisteredValue):
            yield from self._paths(value.value, depth + 1)
        elif isinstance(value, list | tuple):
            for item in value:
                yield from self._paths(item, depth + 1)
        elif hasattr(value, "explicitItems"):
            for item in _items(value):
                yield from self._paths(item, depth + 1)

    def _checked(self, path: str) -> str:
        return check_reference(path, self._shown, self._depth)


def _items(list_op: Any) -> Iterator[Any]:
    """Every item of a list operation, those that it removes included."""
    for name in ("explicitItems", "prependedItems", "appendedItems", "addedItems", "deletedItems", "orderedItems"):
        yield from getattr(list_op, name, ())
