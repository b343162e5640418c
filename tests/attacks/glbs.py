"""Binary glTF files, good and bad."""

from __future__ import annotations

import base64
import copy
import json
import struct
from collections.abc import Callable
from typing import Any

Document = dict[str, Any]
POINTS = struct.pack("<9f", 0, 0, 0, 1, 0, 0, 0, 1, 0)
UVS = struct.pack("<6f", 0, 0, 1, 0, 0, 1)
INDICES = struct.pack("<3H", 0, 1, 2) + b"\0\0"
BUFFER = POINTS + UVS + INDICES


def document() -> Document:
    """A triangle of half transparent red."""
    return {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "translation": [0, 1, 0]}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "indices": 2, "material": 0}]}],
        "materials": [
            {
                "alphaMode": "BLEND",
                "doubleSided": True,
                "pbrMetallicRoughness": {"baseColorFactor": [1, 0, 0, 0.5]},
            }
        ],
        "buffers": [{"byteLength": len(BUFFER)}],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": 36},
            {"buffer": 0, "byteOffset": 36, "byteLength": 24},
            {"buffer": 0, "byteOffset": 60, "byteLength": 8},
        ],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5126, "count": 3, "type": "VEC2"},
            {"bufferView": 2, "componentType": 5123, "count": 3, "type": "SCALAR"},
        ],
    }


def glb(content: Document | bytes, buffer: bytes = BUFFER) -> bytes:
    """The file."""
    text = content if isinstance(content, bytes) else json.dumps(content, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    buffer += b"\0" * (-len(buffer) % 4)
    total = 12 + 8 + len(text) + 8 + len(buffer)
    head = struct.pack("<4sII", b"glTF", 2, total)
    return head + struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(buffer), b"BIN\0") + buffer


def textured(image: bytes, inside: bool) -> bytes:
    """The triangle with an image as its colour, in the buffer or as a data URI."""
    made = document()
    made["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"] = {"index": 0}
    made["textures"] = [{"source": 0, "sampler": 0}]
    made["samplers"] = [{"wrapS": 33071}]
    if not inside:
        made["images"] = [{"uri": "data:image/png;base64," + base64.b64encode(image).decode()}]
        return glb(made)
    made["images"] = [{"bufferView": 3, "mimeType": "image/png"}]
    made["bufferViews"].append({"buffer": 0, "byteOffset": len(BUFFER), "byteLength": len(image)})
    made["buffers"][0]["byteLength"] += len(image)
    return glb(made, BUFFER + image)


def good(image: bytes) -> dict[str, bytes]:
    """Files that are in order."""
    instanced = document()
    instanced["nodes"] = [{"children": [1, 2], "scale": [2, 2, 2]}, {"mesh": 0}, {"mesh": 0, "rotation": [0, 1, 0, 0]}]
    return {
        "triangle.glb": glb(document()),
        "instances.glb": glb(instanced),
        "texture.glb": textured(image, inside=True),
        "texture-data.glb": textured(image, inside=False),
    }


def attacks(canary: str, port: int, image: bytes) -> dict[str, tuple[str, bytes]]:
    """Slug and bytes of bad files by name."""

    def changed(change: Callable[[Document], Any]) -> bytes:
        made = copy.deepcopy(document())
        change(made)
        return glb(made)

    def picture(uri: str) -> bytes:
        return changed(lambda d: d.update(images=[{"uri": uri}]))

    def required(name: str) -> bytes:
        return changed(lambda d: d.update(extensionsRequired=[name], extensionsUsed=[name]))

    def accessor(index: int, **fields: Any) -> bytes:
        return changed(lambda d: d["accessors"][index].update(fields))

    whole = glb(document())
    beyond = POINTS + UVS + struct.pack("<3H", 0, 1, 9)
    huge = image[:16] + struct.pack(">II", 60000, 60000) + image[24:]
    outside = "scene-path-outside"
    cases: dict[str, tuple[str, bytes]] = {
        "buffer-file": (outside, changed(lambda d: d["buffers"][0].update(uri="../canary/canary.bin"))),
        "buffer-url": ("scene-url", changed(lambda d: d["buffers"][0].update(uri=f"http://127.0.0.1:{port}/a.bin"))),
        "buffer-data": (
            outside,
            changed(lambda d: d["buffers"][0].update(uri="data:application/gltf-buffer;base64,AA")),
        ),
        "image-file": (outside, picture(f"{canary}/canary.png")),
        "image-url": ("scene-url", picture(f"http://127.0.0.1:{port}/canary.png")),
        "image-file-url": ("scene-url", picture(f"file://{canary}/canary.png")),
        "image-beside": (outside, picture("canary.png")),
        "image-svg": (outside, picture("data:image/svg+xml;base64,PHN2Zy8+")),
        "image-no-base64": ("scene-damaged", picture("data:image/png;base64,????")),
        "image-postscript": (
            "scene-texture",
            picture("data:image/png;base64," + base64.b64encode(b"%!PS-Adobe").decode()),
        ),
        "image-bomb": ("scene-texture", textured(huge, inside=True)),
        "extension-file": (outside, changed(lambda d: d.update(extensions={"X": [{"uri": "../canary/canary.bin"}]}))),
        "draco": ("scene-format", required("KHR_draco_mesh_compression")),
        "meshopt": ("scene-format", required("EXT_meshopt_compression")),
        "basis": ("scene-format", required("KHR_texture_basisu")),
        "unknown-extension": ("scene-format", required("EXT_unheard_of")),
        "sparse": ("scene-format", accessor(0, sparse={"count": 1})),
        "accessor-no-view": ("scene-format", changed(lambda d: d["accessors"][0].pop("bufferView"))),
        "accessor-count": ("scene-damaged", accessor(0, count=4)),
        "accessor-count-huge": ("scene-too-large", accessor(0, count=1 << 40)),
        "accessor-count-negative": ("scene-damaged", accessor(0, count=-3)),
        "accessor-offset": ("scene-damaged", accessor(2, byteOffset=4)),
        "accessor-type": ("scene-damaged", accessor(0, type="VEC9")),
        "accessor-uneven": ("scene-damaged", accessor(1, count=2)),
        "view-beyond": ("scene-damaged", changed(lambda d: d["bufferViews"][0].update(byteLength=1 << 30))),
        "view-missing": ("scene-damaged", accessor(0, bufferView=99)),
        "index-beyond": ("scene-damaged", glb(document(), beyond)),
        "node-cycle": ("scene-damaged", changed(lambda d: d.update(nodes=[{"children": [1]}, {"children": [0]}]))),
        "node-twice": ("scene-damaged", changed(lambda d: d["scenes"][0].update(nodes=[0, 0]))),
        "node-deep": (
            "scene-too-large",
            changed(lambda d: d.update(nodes=[{"children": [i + 1]} for i in range(400)] + [{"mesh": 0}])),
        ),
        "node-huge": ("scene-damaged", changed(lambda d: d["nodes"][0].update(translation=[1e300, 0, 0]))),
        "nodes-many": (
            "scene-too-large",
            changed(
                lambda d: d.update(
                    meshes=[{"primitives": d["meshes"][0]["primitives"] * 2000}],
                    nodes=[{"mesh": 0}] * 101,
                    scenes=[{"nodes": list(range(101))}],
                )
            ),
        ),
        "json-deep": ("scene-too-large", glb(b"[" * 100_000 + b"]" * 100_000)),
        "json-nan": ("scene-damaged", glb(json.dumps(document()).replace("0.5", "NaN").encode())),
        "json-list": ("scene-damaged", glb(b"[]")),
        "json-utf16": ("scene-damaged", glb(json.dumps(document()).encode("utf-16"))),
        "length": ("scene-damaged", whole[:8] + struct.pack("<I", 1 << 30) + whole[12:]),
        "chunk-length": ("scene-damaged", whole[:12] + b"\xff\xff\xff\x7f" + whole[16:]),
        "version": ("scene-damaged", whole[:4] + b"\1" + whole[5:]),
        "cut": ("scene-damaged", whole[:40]),
        "empty": ("scene-damaged", b""),
    }
    return {f"glb-{name}.glb": case for name, case in cases.items()}
