"""An upload as a whole: every layer in it, and which of them the root layer leads to."""

from __future__ import annotations

import mmap
import posixpath
import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

from pxr import Sdf, Tf

from renderer.gate.archive import Member, read_package
from renderer.gate.compose import PrimCounter
from renderer.gate.files import TEXT_COOKIES, Kind, UploadedFile, list_upload, suffix_of
from renderer.gate.gltf import check_glb
from renderer.gate.layers import LayerContent, read_layer
from renderer.gate.materialx import materialx_files
from renderer.gate.names import check_file_name, split_package
from renderer.gate.problems import RejectedScene, shown
from renderer.gate.text import check_text
from renderer.usd.stage import WarningLog, usd_diagnostics
from schemas.limits import LIMITS

ROOT_SUFFIXES = (".usd", ".usda", ".usdc", ".usdz", ".glb")
COMPOSED: tuple[Kind, ...] = ("layer", "package", "materialx")
MAX_PIXELS = 8 * LIMITS.texture_pixels
"""Pixels of all images together."""


@dataclass
class CheckedUpload:
    """An upload that passed.

    Attributes:
        folder: Where it lies.
        root: Name of the root file.
        layers: Its USD layers by name, kept open; none for a glb.
        prims: About how many prims the scene composes to.
        pixels: Of all images.
        missing: How many named files are not in the upload.
    """

    folder: Path
    root: str
    layers: dict[str, LayerContent] = field(default_factory=dict)
    prims: int = 0
    pixels: int = 0
    missing: int = 0


def check_upload(folder: Path, root: str) -> CheckedUpload:
    """Checks an upload without opening a stage.

    Args:
        folder: Holds the upload's files and nothing else.
        root: Relative name of the file that is the scene.

    Raises:
        RejectedScene: Something in it is not accepted.
    """
    check_file_name(root)
    if suffix_of(root) not in ROOT_SUFFIXES:
        raise RejectedScene("scene-format", f"{shown(root)} is no scene.", "Give a .usdz, .usdc, .usda, .usd or .glb.")
    files = list_upload(folder)
    if root not in files:
        raise RejectedScene("scene-damaged", f"The upload has no file {shown(root)}.", "Name the file to open.")
    if not files[root].size:
        raise RejectedScene("scene-damaged", f"{shown(root)} is empty.")
    if files[root].kind == "glb":
        pixels = check_glb(files[root].path, root)
        return CheckedUpload(folder, root, prims=0, pixels=pixels)
    return _Checker(folder, root, files).check()


class _Checker:
    def __init__(self, folder: Path, root: str, files: dict[str, UploadedFile]) -> None:
        self._files = files
        self._root = root
        self._packages: dict[str, dict[str, Member]] = {}
        self._kinds: dict[str, Kind] = {name: file.kind for name, file in files.items()}
        self._damaged: dict[str, RejectedScene] = {}
        self._checked = CheckedUpload(folder, root)

    def check(self) -> CheckedUpload:
        """Everything, one kind of file after the other."""
        self._checked.pixels = sum(file.pixels for file in self._files.values())
        for name, file in self._files.items():
            if file.kind == "package":
                self._packages[name] = read_package(file.path, name)
                for member in self._packages[name].values():
                    self._kinds[f"{name}[{member.name}]"] = member.kind
                    self._checked.pixels += member.pixels
        if self._checked.pixels > MAX_PIXELS:
            raise RejectedScene("scene-texture", f"The images have more than {MAX_PIXELS} pixels together.")
        self._read_layers()
        _check_clips(self._checked.layers.values())
        named = self._read_documents()
        for content in self._checked.layers.values():
            self._check_named(content)
        for name, files in named.items():
            self._check_assets(name, files)
        used = self._reachable()
        counter = PrimCounter(self._checked.layers, self._layer_for, LIMITS.prims)
        self._checked.prims = counter.count(self._layer_of(self._root) or "")
        self._checked.layers = {name: self._checked.layers[name] for name in used}
        return self._checked

    def _read_layers(self) -> None:
        names = [name for name, kind in self._kinds.items() if kind == "layer"]
        if len(names) > LIMITS.layers:
            raise RejectedScene(
                "scene-too-many-layers", f"The upload has {len(names)} USD layers, more than {LIMITS.layers}."
            )
        for name in names:
            try:
                self._checked.layers[name] = self._read_layer(name)
            except RejectedScene as problem:
                if problem.slug != "scene-damaged":
                    raise
                # USD cannot read it either; it matters only if the scene uses it.
                self._damaged[name] = problem

    def _read_layer(self, name: str) -> LayerContent:
        package, member = split_package(name)
        file = self._files[package]
        start, size = 0, file.size
        if member is not None:
            found = self._packages[package][member]
            start, size = found.offset, found.size
        if size == 0:
            raise RejectedScene("scene-damaged", f"{shown(name)} is empty.")
        with file.path.open("rb") as stream, mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ) as data:
            if data[start : start + 16].startswith(TEXT_COOKIES):
                check_text(bytes(data[start : start + size]), name)
        try:
            with usd_diagnostics(WarningLog()):
                layer = Sdf.Layer.FindOrOpen(f"{self._checked.folder.resolve()}/{name}")
                if not layer:
                    raise RejectedScene("scene-damaged", f"{shown(name)} cannot be read.")
                return read_layer(name, layer)
        except (Tf.ErrorException, RuntimeError, TypeError, ValueError, UnicodeDecodeError) as error:
            raise RejectedScene("scene-damaged", f"{shown(name)} cannot be read.") from error

    def _read_documents(self) -> dict[str, set[str]]:
        """Files that MaterialX documents name, by document."""
        return {
            name: materialx_files(self._bytes(name), name) for name, kind in self._kinds.items() if kind == "materialx"
        }

    def _bytes(self, name: str) -> bytes:
        package, member = split_package(name)
        path = self._files[package].path
        if member is None:
            return path.read_bytes()
        found = self._packages[package][member]
        with path.open("rb") as stream:
            stream.seek(found.offset)
            return stream.read(found.size)

    def _check_named(self, content: LayerContent) -> None:
        for path in sorted(content.arcs):
            package, member = split_package(path)
            suffix = suffix_of(member or package)
            if suffix not in (".usd", ".usda", ".usdc", ".usdz", ".mtlx") or (member and suffix == ".usdz"):
                raise RejectedScene("scene-format", f"{shown(content.name)} composes a file that is no USD layer.")
            for name in self._candidates(content.name, path):
                if self._kinds[name] not in COMPOSED:
                    raise RejectedScene("scene-format", f"{shown(content.name)} composes {shown(name)}, no USD layer.")
        self._check_assets(content.name, content.assets)

    def _check_assets(self, layer: str, paths: set[str]) -> None:
        for path in sorted(paths):
            found = list(self._candidates(layer, path))
            self._checked.missing += not found
            for name in found:
                if self._kinds[name] == "other":
                    raise RejectedScene(
                        "scene-format", f"{shown(layer)} names {shown(name)}, which is of no kind that is accepted."
                    )

    def _candidates(self, layer: str, path: str) -> list[str]:
        """Files of the upload that a resolver takes a path in a layer for, the first of them that exists.

        It looks beside the layer, then in the folder that it works in, which is empty, then beside the root layer.
        """
        package, member = split_package(layer)
        bases = [posixpath.dirname(package), posixpath.dirname(self._root)]
        found = [_inside(base, path) for base in bases]
        if member is not None:
            found += [f"{package}[{_inside(base, path)}]" for base in (posixpath.dirname(member), "")]
        if "<UDIM>" in path:
            tiles = [re.compile(re.escape(name).replace("<UDIM>", "[0-9]{4}")) for name in found]
            return [name for name in self._kinds if any(tile.fullmatch(name) for tile in tiles)]
        return [name for name in dict.fromkeys(found) if name in self._kinds]

    def _layer_for(self, layer: str, path: str) -> str | None:
        """The layer that a path in a layer leads to; None for what is missing, damaged or no USD."""
        from_package = split_package(layer)[1] is not None
        found = [self._layer_of(name) for name in self._candidates(layer, path.removeprefix("./"))]
        if from_package:
            found.reverse()
        return next((name for name in found if name is not None), None)

    def _layer_of(self, name: str) -> str | None:
        if name in self._packages:
            name = f"{name}[{next(iter(self._packages[name]))}]"
        return name if name in self._checked.layers else None

    def _reachable(self) -> list[str]:
        """Layers that the root leads to.

        Raises:
            RejectedScene: One of them is damaged, or they lead too deep.
        """
        root = (
            self._root
            if self._root not in self._packages
            else f"{self._root}[{next(iter(self._packages[self._root]))}]"
        )
        found: dict[str, int] = {root: 0}
        pending = [root]
        for name in pending:
            if name in self._damaged:
                raise self._damaged[name]
            if found[name] > LIMITS.nesting:
                raise RejectedScene("scene-too-many-layers", f"Layers lead deeper than {LIMITS.nesting} in each other.")
            for path in self._checked.layers[name].arcs:
                for target in self._candidates(name, path):
                    if target in self._packages:
                        target = f"{target}[{next(iter(self._packages[target]))}]"
                    if self._kinds[target] == "layer" and target not in found:
                        found[target] = found[name] + 1
                        pending.append(target)
        return list(found)


def _check_clips(layers: Iterable[LayerContent]) -> None:
    """Bounds the steps of value clips, for each of which USD looks for a file.

    Start, end and stride may come from different layers, so the widest range counts with the smallest stride.
    """
    found: dict[str, list[float]] = {"starttime": [], "endtime": [], "stride": []}
    for content in layers:
        for name, times in content.clip_times.items():
            found[name] += times
    strides = [stride for stride in found["stride"] if stride > 0.0]  # USD refuses others
    if not (found["starttime"] and found["endtime"] and strides):
        return
    steps = (max(found["endtime"]) - min(found["starttime"])) / min(strides)
    if not steps <= LIMITS.clip_steps:
        raise RejectedScene(
            "scene-too-large", f"The value clips have {steps:.3g} steps, more than {LIMITS.clip_steps}."
        )


def _inside(base: str, path: str) -> str:
    return posixpath.normpath(posixpath.join(base, path))
