"""What glTF's material extensions say that is drawn, and what of a glTF file is not: for both ways to convert one."""

from __future__ import annotations

import base64
import json
import re
import struct
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final
from urllib.parse import unquote

from renderer.authoring import GlassLook
from renderer.gate.gltf import damaged, floats

TRANSMISSION: Final = "KHR_materials_transmission"
READ: Final = (TRANSMISSION, "KHR_materials_volume", "KHR_materials_ior")
"""Extensions of materials that are drawn, where the material transmits light."""
NOT_DRAWN: Final = {
    "animations": "animations are left out: the scene is as at rest",
    "skins": "skins are left out: the meshes keep their bind pose",
    "cameras": "cameras are left out",
}
"""Lists of a document -> what becomes of them."""
_WORD: Final = re.compile(r"[A-Z]+_[A-Za-z0-9_]{1,60}")


def glass_of(name: str, material: Mapping[str, Any]) -> tuple[GlassLook, Any] | None:
    """How a glTF material transmits light, without its texture, and the reference to that; None if it does not.

    Args:
        name: Of the file, for messages.
        material: As parsed.

    Raises:
        RejectedScene: An extension contradicts the specification.
    """
    transmission = _extension(name, material, TRANSMISSION)
    factor = _number(name, transmission, "transmissionFactor", 0.0)
    if factor <= 0.0:
        return None
    volume = _extension(name, material, "KHR_materials_volume")
    colour = floats(name, volume.get("attenuationColor", (1, 1, 1)), 3).clip(0.0, 1.0)
    found = GlassLook(
        transmission=min(factor, 1.0),
        ior=_number(name, _extension(name, material, "KHR_materials_ior"), "ior", 1.5),
        attenuation=(float(colour[0]), float(colour[1]), float(colour[2])),
        distance=_number(name, volume, "attenuationDistance", 0.0),
        thickness=_number(name, volume, "thicknessFactor", 0.0),
    )
    return found, transmission.get("transmissionTexture")


def transmits(document: Mapping[str, Any]) -> bool:
    """Whether a document has a material that transmits light."""
    return any(TRANSMISSION in material.get("extensions", {}) for material in document.get("materials", []))


def left_out(document: Mapping[str, Any]) -> Iterator[str]:
    """What of a document is not drawn, one line each."""
    for key, text in NOT_DRAWN.items():
        if document.get(key):
            yield text
    named = re.findall(r'"(KHR_[A-Za-z0-9_]+)"', json.dumps(document.get("materials", [])))
    for extension in sorted(set(named) - set(READ)):
        yield f"{extension} is left out"
    used = document.get("extensionsUsed", [])
    for extension in used if isinstance(used, list) else ():
        is_word = isinstance(extension, str) and _WORD.fullmatch(extension)
        if is_word and extension not in named and not extension.startswith("KHR_materials_"):
            yield f"{extension} is left out"


def _extension(name: str, material: Mapping[str, Any], extension: str) -> Mapping[str, Any]:
    extensions = material.get("extensions", {})
    found = extensions.get(extension, {}) if isinstance(extensions, dict) else None
    if not isinstance(found, dict):
        raise damaged(name)
    return found


def _number(name: str, item: Mapping[str, Any], key: str, default: float) -> float:
    """A number of at least 0."""
    return max(float(floats(name, [item.get(key, default)], 1)[0]), 0.0)


def numbered(data: bytes) -> bytes:
    """A file whose materials are called by their index, a colon and their name, for readers that keep the name alone.

    Args:
        data: Of a .glb or a .gltf that can be parsed.
    """
    document = document_of(data)
    for index, material in enumerate(document.get("materials", [])):
        material["name"] = f"{index}:{material.get('name', '')}"
    text = json.dumps(document).encode()
    if data[:4] != b"glTF":
        return text
    text += b" " * (-len(text) % 4)
    rest = data[20 + struct.unpack_from("<I", data, 12)[0] :]
    head = struct.pack("<4sII", b"glTF", 2, 20 + len(text) + len(rest))
    return head + struct.pack("<I4s", len(text), b"JSON") + text + rest


def document_of(data: bytes) -> dict[str, Any]:
    """The JSON of a .glb or a .gltf that can be parsed."""
    if data[:4] == b"glTF":
        data = data[20 : 20 + struct.unpack_from("<I", data, 12)[0]]
    document: dict[str, Any] = json.loads(data)
    return document


def image_bytes(data: bytes, folder: Path, texture: int) -> bytes:
    """The file of a texture's image: in the buffer, in a data URI, or beside the document.

    Args:
        data: Of a .glb or a .gltf.
        folder: That it lies in; no image is looked for elsewhere.
        texture: Index.

    Raises:
        OSError: It cannot be read.
        LookupError: There is none.
        ValueError: It is damaged.
    """
    document = document_of(data)
    image = document["images"][document["textures"][texture]["source"]]
    if "uri" in image:
        return _content(str(image["uri"]), folder)
    view = document["bufferViews"][image["bufferView"]]
    start, size = view.get("byteOffset", 0), view["byteLength"]
    uri = document["buffers"][view.get("buffer", 0)].get("uri")
    if uri is not None:
        return _content(str(uri), folder)[start : start + size]
    at = 28 + struct.unpack_from("<I", data, 12)[0] + start
    return data[at : at + size]


def _content(uri: str, folder: Path) -> bytes:
    if uri.startswith("data:"):
        return base64.b64decode(uri.partition(",")[2])
    file = (folder / unquote(uri)).resolve()
    if not file.is_relative_to(folder.resolve()):
        raise FileNotFoundError(uri)
    return file.read_bytes()
