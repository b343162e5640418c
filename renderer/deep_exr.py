"""Deep OpenEXR: every fragment of a view as a sample that compositing tools read, and back.

Rules, those of the OpenEXR documents ("Interpreting OpenEXR Deep Pixels", "Theory of OpenEXR Deep Samples") and of what
DeepRead of a compositor expects:

- samples are points (Z without ZBack), front to back inside a pixel; depth is the distance along the view axis;
- R, G, B and A are half floats, linear Rec. 709, colour premultiplied by alpha; Z is a float;
- where an opaque surface is, it is the last sample, with A = 1; where nothing is, there is no sample, and the colour
  that stands there is the attribute `clearColor`. Flattened over that colour, the file is the exact picture.

The stored 8-bit colours and alphas survive the way through half floats and premultiplication exactly, all of them.

The writer makes the file from the dump's arrays, row by row: OpenEXR's Python module, which takes an array object for
each pixel and channel, needs eight times as long. It reads, being the one that knows every kind of file.
"""

from __future__ import annotations

import os
import struct
import zlib
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import OpenEXR
from numpy.typing import NDArray

from renderer.exr_header import DEEP, FLOAT, HALF, MAGIC, REC709, Attribute, attribute, channel_list, packed, window
from schemas.colour import decode_gamma2, encode_gamma2
from schemas.fragments import FragmentDump
from schemas.problem import ExitCode, Problem

CLEAR = "clearColor"
"""Attribute: linear RGB where no sample is opaque."""

_ZIPS = 2
_LEVEL = 1
"""Of zlib: half the time of OpenEXR's own default for a twentieth more bytes."""

_ALPHA = (np.arange(256) / 255.0).astype("<f2")
_PREMULTIPLIED = (decode_gamma2(np.arange(256, dtype=np.uint8))[None, :] * (np.arange(256) / 255.0)[:, None]).astype(
    "<f2"
)
"""Half [alpha, stored colour]."""


def write_deep_exr(
    path: Path,
    dump: FragmentDump,
    opaque_depth: NDArray[np.float32],
    attributes: Mapping[str, Attribute] | None = None,
) -> None:
    """Write a dump as a deep scan-line file, ZIPS-compressed.

    Args:
        path: The file.
        dump: Fragments of a view.
        opaque_depth: float32 [P], metres along the view axis; infinite where no opaque surface is.
        attributes: Further attributes of the header.
    """
    rows = [slice(y * dump.width, (y + 1) * dump.width) for y in range(dump.height)]
    head = _header(dump, opaque_depth, attributes or {})
    with path.open("wb") as stream:
        stream.write(head)
        table = stream.tell()
        stream.write(bytes(8 * dump.height))
        with ThreadPoolExecutor(len(os.sched_getaffinity(0))) as pool:
            chunks = pool.map(lambda y: _chunk(y, dump, opaque_depth, rows[y]), range(dump.height))
            starts = [_append(stream, chunk) for chunk in chunks]
        stream.seek(table)
        stream.write(struct.pack(f"<{dump.height}Q", *starts))


def _append(stream: BinaryIO, chunk: bytes) -> int:
    start = stream.tell()
    stream.write(chunk)
    return start


def _header(dump: FragmentDump, opaque_depth: NDArray[np.float32], attributes: Mapping[str, Attribute]) -> bytes:
    solid = np.isfinite(opaque_depth)
    most = int((dump.counts + solid).max(initial=0))
    channels = channel_list({**dict.fromkeys("RGBA", HALF), "Z": FLOAT})
    size = window(dump.width, dump.height)
    clear = dump.background[~solid][:1]
    every = {
        "channels": packed("channels", "chlist", channels),
        "chromaticities": packed("chromaticities", "chromaticities", struct.pack("<8f", *REC709)),
        "chunkCount": attribute("chunkCount", dump.height),
        "compression": packed("compression", "compression", bytes([_ZIPS])),
        "dataWindow": packed("dataWindow", "box2i", size),
        "displayWindow": packed("displayWindow", "box2i", size),
        "lineOrder": packed("lineOrder", "lineOrder", bytes(1)),
        "maxSamplesPerPixel": attribute("maxSamplesPerPixel", most),
        "name": attribute("name", "fragments"),
        "pixelAspectRatio": attribute("pixelAspectRatio", 1.0),
        "screenWindowCenter": packed("screenWindowCenter", "v2f", bytes(8)),
        "screenWindowWidth": attribute("screenWindowWidth", 1.0),
        "type": attribute("type", "deepscanline"),
        "version": attribute("version", 1),
        CLEAR: attribute(CLEAR, decode_gamma2(clear[0] if len(clear) else np.zeros(3, np.uint8))),
    }
    every |= {name: attribute(name, value) for name, value in attributes.items()}
    return struct.pack("<ii", MAGIC, DEEP) + b"".join(every[name] for name in sorted(every)) + b"\0"


def _chunk(y: int, dump: FragmentDump, opaque_depth: NDArray[np.float32], row: slice) -> bytes:
    """A row: its number, three sizes, running sums of the samples of its pixels, the samples."""
    counts, planes = _row(dump, opaque_depth, row)
    table = _zips(np.cumsum(counts).astype("<i4").tobytes())
    raw = b"".join(plane.tobytes() for plane in planes)
    samples = _zips(raw)
    return struct.pack("<iQQQ", y, len(table), len(samples), len(raw)) + table + samples


def _row(
    dump: FragmentDump, opaque_depth: NDArray[np.float32], row: slice
) -> tuple[NDArray[np.int64], tuple[NDArray[Any], ...]]:
    """Samples of each pixel of a row, and the planes A, B, G, R, Z of all of them."""
    begin, end = int(dump.offsets[row.start]), int(dump.offsets[row.stop])
    n = np.diff(dump.offsets[row.start : row.stop + 1])
    solid = np.isfinite(opaque_depth[row])
    counts = n + solid
    # A fragment moves back by the opaque samples of the pixels before its own.
    before = np.cumsum(solid) - solid
    place = np.arange(end - begin) + np.repeat(before, n)
    last = (np.cumsum(counts) - 1)[solid]
    rgba = np.full((int(counts.sum()), 4), 255, dtype=np.uint8)
    rgba[place] = dump.rgba[begin:end]
    rgba[last, :3] = dump.background[row][solid]
    depth = np.empty(len(rgba), dtype="<f4")
    depth[place] = dump.depth[begin:end]
    depth[last] = _behind(opaque_depth[row], dump.depth[begin:end], n)[solid]
    line = rgba[:, 3].astype(np.uint16) << 8
    red, green, blue = (np.take(_PREMULTIPLIED, line | rgba[:, channel]) for channel in range(3))
    return counts, (np.take(_ALPHA, rgba[:, 3]), blue, green, red, depth)


def _behind(opaque: NDArray[np.float32], depth: NDArray[np.float32], n: NDArray[np.int64]) -> NDArray[np.float32]:
    """The opaque depths, never in front of a pixel's last fragment: the depth buffer has fewer digits than a dump."""
    farthest = np.full(len(n), -np.inf, dtype=np.float32)
    farthest[n > 0] = depth[(np.cumsum(n) - 1)[n > 0]]
    return np.maximum(opaque, farthest)


def _zips(raw: bytes) -> bytes:
    """Even bytes, then odd ones, each as the difference to the one before, deflated; as it is where that is no gain."""
    data = np.frombuffer(raw, dtype=np.uint8)
    sorted_bytes = np.concatenate((data[0::2], data[1::2]))
    differences = sorted_bytes.copy()
    differences[1:] -= sorted_bytes[:-1]
    differences[1:] += 128
    small = zlib.compress(differences.data, _LEVEL)
    return small if len(small) < len(raw) else raw


def read_deep_exr(path: Path) -> FragmentDump:
    """Read a deep file as a dump: colours divided by alpha and rounded to 8 bits.

    A pixel's samples are sorted by depth; those behind an opaque one, and those without opacity, are left out. The
    nearest opaque one is the background, else it is `clearColor`, else black. `facing` is not in such a file: 255
    where a fragment is.

    Args:
        path: A file with R, G, B, A and Z in its first part. ZBack, if any, is ignored.

    Raises:
        Problem: It is missing or no such file.
    """
    header, channels = _opened(path)
    counts = np.vectorize(lambda samples: 0 if samples is None else len(samples), otypes=[np.int64])(channels["Z"])
    height, width = counts.shape
    pixel = np.repeat(np.arange(width * height), counts.ravel())
    columns = {name: _joined(channels[name], int(counts.sum()), path) for name in "RGBAZ"}
    alpha = np.floor(np.clip(columns["A"], 0.0, 1.0) * 255.0 + 0.5)
    straight = (
        np.stack([columns[name] for name in "RGB"], axis=1) / np.where(columns["A"] > 0, columns["A"], 1)[:, None]
    )
    rgba = np.concatenate((encode_gamma2(straight), alpha[:, None].astype(np.uint8)), axis=1)
    rgba = np.ascontiguousarray(rgba)
    order = np.lexsort((rgba.view("<u4")[:, 0], columns["Z"], pixel))
    clear = encode_gamma2(np.asarray(header.get(CLEAR, (0.0, 0.0, 0.0)), dtype=np.float64))
    return _dump(width, height, pixel[order], rgba[order], columns["Z"][order].astype(np.float32), clear)


def _dump(
    width: int,
    height: int,
    pixel: NDArray[np.int64],
    rgba: NDArray[np.uint8],
    depth: NDArray[np.float32],
    clear: NDArray[np.uint8],
) -> FragmentDump:
    """Fragments up to the first opaque sample of each pixel, whose colour is the background."""
    pixels = width * height
    first = np.full(pixels, len(pixel))
    solid = np.flatnonzero(rgba[:, 3] == 255)
    np.minimum.at(first, pixel[solid], solid)
    background = np.tile(clear, (pixels, 1))
    has = first < len(pixel)
    background[has] = rgba[first[has], :3]
    kept = (np.arange(len(pixel)) < first[pixel]) & (rgba[:, 3] > 0) & (depth > 0) & np.isfinite(depth)
    n = np.bincount(pixel[kept], minlength=pixels)
    offsets = np.concatenate(([0], np.cumsum(n))).astype(np.int64)
    facing = np.where(n > 0, 255, 0).astype(np.uint8)
    return FragmentDump(width, height, offsets, rgba[kept], depth[kept], background, facing)


def _opened(path: Path) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
    if not path.is_file():
        raise Problem(f"There is no file {path}.", "Check the path.", ExitCode.NOT_FOUND)
    try:
        with OpenEXR.File(str(path), separate_channels=True) as file:
            header, found = dict(file.header()), file.channels()  # closing empties the header
            channels = {name: channel.pixels for name, channel in found.items()}
    except (RuntimeError, ValueError, IndexError) as error:
        # Of a damaged file the library makes one without parts.
        raise Problem(f"{path} is no OpenEXR file that can be read.", "Export it again.") from error
    if not {"R", "G", "B", "A", "Z"} <= channels.keys() or channels["Z"].dtype != object:
        raise Problem(f"{path} has no deep samples with R, G, B, A and Z.", "Export these channels, as deep data.")
    return header, channels


def _joined(samples: NDArray[Any], total: int, path: Path) -> NDArray[np.float64]:
    """All samples of a channel, float64 [N]."""
    joined = np.concatenate([np.empty(0, np.float32), *(part for part in samples.flat if part is not None)])
    if len(joined) != total:
        raise Problem(f"The channels of {path} have different numbers of samples.", "Export it again.")
    return np.nan_to_num(joined.astype(np.float64), posinf=1.0, neginf=0.0)
