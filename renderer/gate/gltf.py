"""Binary glTF (.glb): its JSON and the bounds of everything it points to, before any of it is read as geometry."""

from __future__ import annotations

import base64
import binascii
import json
import math
import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.gate.images import check_image, is_image
from renderer.gate.problems import RejectedScene, shown
from schemas.limits import LIMITS

MAX_JSON_BYTES = 64 << 20
MAX_JSON_DEPTH = 64
MAX_NODE_DEPTH = 256
COMPONENTS: dict[int, np.dtype[Any]] = {
    5120: np.dtype("<i1"),
    5121: np.dtype("<u1"),
    5122: np.dtype("<i2"),
    5123: np.dtype("<u2"),
    5125: np.dtype("<u4"),
    5126: np.dtype("<f4"),
}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
IMAGE_HEADS = ("data:image/png;base64,", "data:image/jpeg;base64,")
KNOWN_REQUIRED = frozenset(("KHR_texture_transform",))
"""Extensions without which a file may not be read, beside materials' (their base colour is what is used)."""

Object = dict[str, Any]


@dataclass
class GlbContent:
    """A checked file: its JSON, its buffer, and what has been read of it so far."""

    name: str
    document: Object
    buffer: memoryview
    _arrays: dict[int, NDArray[Any]] = field(default_factory=dict)
    _items: dict[str, list[Object]] = field(default_factory=dict)

    def items(self, key: str) -> list[Object]:
        """The objects of a list at the top of the document, looked at once: every pick asks for it."""
        if key not in self._items:
            found = self.document.get(key, [])
            if not isinstance(found, list) or not all(isinstance(item, dict) for item in found):
                raise damaged(self.name)
            self._items[key] = found
        return self._items[key]

    def view(self, index: Any) -> memoryview:
        """The bytes of a buffer view."""
        view = self.pick("bufferViews", index)
        start, size = number(self.name, view, "byteOffset", 0), number(self.name, view, "byteLength")
        if view.get("buffer", 0) != 0 or start + size > len(self.buffer):
            raise damaged(self.name)
        return self.buffer[start : start + size]

    def pick(self, key: str, index: Any) -> Object:
        """An object of a list by its index."""
        items = self.items(key)
        if isinstance(index, bool) or not isinstance(index, int) or not 0 <= index < len(items):
            raise damaged(self.name)
        return items[index]

    def array(self, index: Any) -> NDArray[Any]:
        """The values of an accessor [count, width], as stored, not normalised."""
        accessor = self.pick("accessors", index)
        if index not in self._arrays:
            self._arrays[index] = self._read(accessor)
        return self._arrays[index]

    def _read(self, accessor: Object) -> NDArray[Any]:
        dtype, width = self._type(accessor)
        count, offset = number(self.name, accessor, "count"), number(self.name, accessor, "byteOffset", 0)
        if count > LIMITS.points * 6:
            raise RejectedScene("scene-too-large", f"{shown(self.name)} has an array that is too large.")
        view = self.pick("bufferViews", accessor.get("bufferView"))
        data = self.view(accessor["bufferView"])
        size = dtype.itemsize * width
        stride = number(self.name, view, "byteStride", size) or size
        if count < 1 or stride < size or stride > 252 + size or offset + stride * (count - 1) + size > len(data):
            raise damaged(self.name)
        return np.ndarray((count, width), dtype, data, offset, (stride, dtype.itemsize))

    def _type(self, accessor: Object) -> tuple[np.dtype[Any], int]:
        if "sparse" in accessor or "bufferView" not in accessor:
            raise RejectedScene("scene-format", f"{shown(self.name)} has sparse arrays.", "Export it without them.")
        try:
            return COMPONENTS[accessor["componentType"]], WIDTHS[accessor["type"]]
        except (KeyError, TypeError) as error:
            raise damaged(self.name) from error

    def image(self, index: Any) -> bytes:
        """The bytes of an image, a PNG or JPEG of a size that is accepted."""
        image = self.pick("images", index)
        uri = image.get("uri")
        if uri is None:
            data = bytes(self.view(image.get("bufferView")))
        else:
            try:
                data = base64.b64decode(str(uri).partition(",")[2], validate=True)
            except (binascii.Error, ValueError) as error:
                raise damaged(self.name) from error
        if not is_image(data[:16]):
            raise RejectedScene("scene-texture", f"{shown(self.name)} has an image that is no PNG or JPEG.")
        check_image(self.name, data)
        return data


def damaged(name: str) -> RejectedScene:
    """The problem of a file that contradicts itself."""
    return RejectedScene("scene-damaged", f"{shown(name)} is damaged.", "Check it with the glTF validator.")


def number(name: str, item: Object, key: str, default: int | None = None) -> int:
    """A whole number of at least 0.

    Raises:
        RejectedScene: It is missing or something else.
    """
    value = item.get(key, default)
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value < 1 << 53:
        raise damaged(name)
    return value


def check_glb(path: Path, name: str) -> int:
    """Checks a file; the pixels of its images.

    Raises:
        RejectedScene: It is damaged, names other files, needs a decoder, or is too large.
    """
    content = read_glb(path, name)
    pixels = sum(check_image(name, content.image(index)) for index in range(len(content.items("images"))))
    if pixels > 8 * LIMITS.texture_pixels:
        raise RejectedScene("scene-texture", f"The images of {shown(name)} have too many pixels together.")
    sizes = [_mesh_size(content, mesh) for mesh in content.items("meshes")]
    points = triangles = prims = 0
    for node, _, _ in _reached(content):
        prims += 1
        if "mesh" in node:
            mesh = content.pick("meshes", node["mesh"])
            prims += len(mesh["primitives"])
            points += sizes[node["mesh"]][0]
            triangles += sizes[node["mesh"]][1]
        if prims > LIMITS.prims or points > LIMITS.points or triangles > LIMITS.triangles:
            raise RejectedScene("scene-too-large", f"{shown(name)} has too many nodes, points or triangles.")
    for _ in walk_nodes(content):
        pass  # every transform is one
    return pixels


def read_glb(path: Path, name: str) -> GlbContent:
    """Its JSON, with nothing in it that leads outside, and its buffer.

    Raises:
        RejectedScene: It is damaged, names other files or needs a decoder.
    """
    data = memoryview(path.read_bytes())
    if len(data) < 20 or bytes(data[:4]) != b"glTF" or struct.unpack_from("<II", data, 4) != (2, len(data)):
        raise damaged(name)
    size, kind = struct.unpack_from("<II", data, 12)
    if kind != 0x4E4F534A or 20 + size > len(data):
        raise damaged(name)
    document = _parse(bytes(data[20 : 20 + size]), name)
    buffer = memoryview(b"")
    at = 20 + size
    if at + 8 <= len(data):
        length, kind = struct.unpack_from("<II", data, at)
        if kind != 0x004E4942 or at + 8 + length > len(data):
            raise damaged(name)
        buffer = data[at + 8 : at + 8 + length]
    content = GlbContent(name, document, buffer)
    _check_document(content)
    return content


def _parse(text: bytes, name: str) -> Object:
    if len(text) > MAX_JSON_BYTES:
        raise RejectedScene("scene-too-large", f"The description in {shown(name)} is too large.")
    depth = 0
    # Brackets in strings count too: nobody has so many.
    for byte in np.frombuffer(text, np.uint8)[np.isin(np.frombuffer(text, np.uint8), list(b"[]{}"))].tolist():
        depth += 1 if byte in b"[{" else -1
        if depth > MAX_JSON_DEPTH:
            raise RejectedScene("scene-too-large", f"The description in {shown(name)} is too deep.")
    try:
        document = json.loads(text.decode("utf-8"), parse_constant=_no_constant)
    except (ValueError, RecursionError) as error:
        raise damaged(name) from error
    if not isinstance(document, dict):
        raise damaged(name)
    return document


def _no_constant(text: str) -> float:
    raise ValueError(text)


def _check_document(content: GlbContent) -> None:
    name = content.name
    for uri in _uris(content.document):
        if not (isinstance(uri, str) and uri.startswith(IMAGE_HEADS)):
            remote = isinstance(uri, str) and "://" in uri
            raise RejectedScene(
                "scene-url" if remote else "scene-path-outside",
                f"{shown(name)} names other files.",
                "Pack everything into the one .glb.",
            )
    required = content.document.get("extensionsRequired", [])
    for extension in required if isinstance(required, list) else [None]:
        if extension not in KNOWN_REQUIRED and not str(extension).startswith("KHR_materials_"):
            raise RejectedScene(
                "scene-format",
                f"{shown(name)} needs an extension that is not read.",
                "Export it without compression of meshes or textures.",
            )
    buffers = content.items("buffers")
    if len(buffers) > 1 or any(number(name, b, "byteLength") > len(content.buffer) for b in buffers):
        raise damaged(name)


def _uris(value: Any) -> Iterator[Any]:
    """Every value of a key `uri`, at any depth."""
    pending = [value]
    while pending:
        item = pending.pop()
        if isinstance(item, dict):
            yield from (found for key, found in item.items() if key.lower() in ("uri", "url", "href"))
            pending.extend(item.values())
        elif isinstance(item, list):
            pending.extend(item)


def _mesh_size(content: GlbContent, mesh: Object) -> tuple[int, int]:
    """Points of a mesh, and the most triangles that they may be joined to; checks its arrays."""
    primitives = mesh.get("primitives")
    if not isinstance(primitives, list):
        raise damaged(content.name)
    points = triangles = 0
    for primitive in primitives:
        attributes = primitive.get("attributes") if isinstance(primitive, dict) else None
        if not isinstance(attributes, dict) or "POSITION" not in attributes:
            raise damaged(content.name)
        arrays = {key: content.array(index) for key, index in attributes.items()}
        count = len(arrays["POSITION"])
        if any(len(array) != count for array in arrays.values()) or arrays["POSITION"].dtype != COMPONENTS[5126]:
            raise damaged(content.name)
        if arrays["POSITION"].shape[1] != 3:
            raise damaged(content.name)
        if "indices" in primitive:
            corners = number(content.name, content.pick("accessors", primitive["indices"]), "count")
            indices = content.array(primitive["indices"])
            if indices.dtype.kind != "u" or indices.shape[1] != 1 or int(indices.max()) >= count:
                raise damaged(content.name)
        else:
            corners = count
        points += count
        # In strips and fans every corner makes one.
        triangles += corners if primitive.get("mode", 4) in (5, 6) else corners // 3
    return points, triangles


def walk_nodes(content: GlbContent) -> Iterator[tuple[Object, NDArray[np.float64]]]:
    """The nodes of the default scene, parents first, each with its matrix [4, 4] (columns) to the scene.

    Raises:
        RejectedScene: They are no forest, or a transform is none.
    """
    matrices: dict[int, NDArray[np.float64]] = {}
    for node, index, parent in _reached(content):
        above = np.eye(4) if parent is None else matrices[parent]
        matrices[index] = above @ _matrix(content.name, node)
        yield node, matrices[index]


def _reached(content: GlbContent) -> Iterator[tuple[Object, int, int | None]]:
    """The nodes of the default scene, parents first, each with its index and its parent's.

    Raises:
        RejectedScene: They are no forest.
    """
    scenes = content.items("scenes")
    chosen = content.pick("scenes", content.document.get("scene", 0)).get("nodes", []) if scenes else []
    pending: list[tuple[Any, int | None, int]] = []
    pending += [(index, None, 0) for index in reversed(chosen)] if isinstance(chosen, list) else []
    seen: set[int] = set()
    while pending:
        index, parent, depth = pending.pop()
        node = content.pick("nodes", index)
        if index in seen:
            raise damaged(content.name)
        if depth > MAX_NODE_DEPTH:
            raise RejectedScene("scene-too-large", f"{shown(content.name)} has nodes too deep in each other.")
        seen.add(index)
        yield node, index, parent
        children = node.get("children", [])
        if not isinstance(children, list):
            raise damaged(content.name)
        pending.extend((child, index, depth + 1) for child in reversed(children))


def _matrix(name: str, node: Object) -> NDArray[np.float64]:
    if "matrix" in node:
        return floats(name, node["matrix"], 16).reshape(4, 4).T
    matrix = np.eye(4)
    if not {"rotation", "scale", "translation"} & node.keys():
        return matrix
    x, y, z, w = floats(name, node.get("rotation", (0, 0, 0, 1)), 4)
    matrix[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    matrix[:3, :3] *= floats(name, node.get("scale", (1, 1, 1)), 3)
    matrix[:3, 3] = floats(name, node.get("translation", (0, 0, 0)), 3)
    return matrix


def floats(name: str, value: Any, size: int) -> NDArray[np.float64]:
    """So many finite numbers.

    Raises:
        RejectedScene: They are not.
    """
    listed = list(value) if isinstance(value, list | tuple) else []
    good = all(isinstance(x, int | float) and not isinstance(x, bool) for x in listed)
    if len(listed) != size or not good or not all(math.isfinite(x) and abs(x) < 1e30 for x in listed):
        raise damaged(name)
    return np.array(listed, dtype=np.float64)
