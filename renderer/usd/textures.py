"""Images that materials sample: found through the asset resolver, decoded to 8 bits, kept once each."""

from __future__ import annotations

import io
import tempfile
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import OpenEXR
from numpy.typing import NDArray
from PIL import Image
from pxr import Ar

from renderer.usd.stage import is_inside
from renderer.usd.udim import Grid, atlas, grid_of
from schemas.colour import linear_to_srgb, srgb_to_linear
from schemas.limits import LIMITS
from schemas.scene import Texture, Wrap

MAX_SIDE = 2048
"""Larger images are scaled down to this many pixels a side: views are about that large."""

PNG, EXR = b"\x89PNG\r\n\x1a\n", b"\x76\x2f\x31\x01"
_PNG_DEPTH = 24
"""Byte of a PNG's header that says how many bits a channel has."""


class TextureUnreadable(Exception):
    """The image is missing or no image that can be decoded."""


@dataclass(frozen=True, slots=True)
class ImageFile:
    """An image, or the tiles of one.

    Attributes:
        path: What the asset resolver gave, also inside a package (`x.usdz[y.png]`); with `<UDIM>` where it has tiles.
        name: For messages.
        space: `sourceColorSpace`: auto, raw or sRGB.
        tiles: UDIM numbers and resolved paths.
    """

    path: str
    name: str
    space: str
    tiles: tuple[tuple[int, str], ...] = ()


@dataclass(frozen=True, slots=True)
class Decoded:
    """An image as it is sampled.

    Attributes:
        pixels: uint8 [h, w, 4], row 0 at the bottom. A single channel is repeated in R, G and B.
        srgb: Whether R, G and B are sRGB-encoded.
        has_alpha: Whether the file has an alpha channel; where it has none A is 255.
        grid: First column, first row, columns and rows of UDIM tiles; (0, 0, 1, 1) of a single image.
    """

    pixels: NDArray[np.uint8]
    srgb: bool
    has_alpha: bool
    grid: Grid = (0, 0, 1, 1)


@dataclass
class TextureTable:
    """The textures of a scene, each image and way of sampling it once.

    Attributes:
        home: Folder that images have to lie in, resolved; None: anywhere.
        textures: What was asked for so far.
    """

    home: Path | None = None
    textures: list[Texture] = field(default_factory=list)
    _index: dict[tuple[ImageFile, tuple[Wrap, Wrap], int | None, bool], int] = field(default_factory=dict)
    _images: dict[ImageFile, Decoded] = field(default_factory=dict)

    def load(self, file: ImageFile) -> Decoded:
        """The decoded image.

        Raises:
            TextureUnreadable: There is no such image.
        """
        if not all(is_inside(self.home, path) for path in ([path for _, path in file.tiles] or [file.path])):
            raise TextureUnreadable("the texture is missing")
        if file not in self._images:
            self._images[file] = _decode_tiles(file) if file.tiles else decode_image(read_asset(file.path), file.space)
        return self._images[file]

    def colour(self, file: ImageFile, wrap: tuple[Wrap, Wrap], channel: int | None) -> int:
        """Index of a texture whose RGB is a colour; with a channel 0..3, that channel as a grey."""
        image = self.load(file)
        if channel is None:
            return self._add(file, wrap, None, image.srgb, image.pixels)
        grey = np.repeat(image.pixels[..., channel, None], 4, axis=2)
        # Alpha is never encoded.
        return self._add(file, wrap, channel, image.srgb and channel < 3, grey)

    def opacity(self, file: ImageFile, wrap: tuple[Wrap, Wrap], channel: int) -> int:
        """Index of a texture one channel of which is an opacity, so that the sampler need not decode it."""
        image = self.load(file)
        if channel == 3 or not image.srgb:
            # Alpha is never encoded, so the colour texture of the same image serves.
            return self._add(file, wrap, None, image.srgb, image.pixels)
        linear = image.pixels.copy()
        linear[..., channel] = _to_bytes(srgb_to_linear(image.pixels[..., channel] / 255.0))
        return self._add(file, wrap, channel, False, linear)

    def channel_range(self, file: ImageFile, channel: int) -> tuple[float, float]:
        """Smallest and largest linear value, in [0,1], of a channel."""
        image = self.load(file)
        ends = np.array([image.pixels[..., channel].min(), image.pixels[..., channel].max()]) / 255.0
        low, high = srgb_to_linear(ends) if image.srgb and channel < 3 else ends
        return float(low), float(high)

    def _add(
        self, file: ImageFile, wrap: tuple[Wrap, Wrap], channel: int | None, srgb: bool, pixels: NDArray[np.uint8]
    ) -> int:
        key = (file, wrap, channel, srgb)
        if key not in self._index:
            self._index[key] = len(self.textures)
            self.textures.append(Texture(file.name, pixels, srgb, wrap))
        return self._index[key]


def read_asset(resolved: str) -> bytes:
    """The bytes of an asset on disk or inside a package.

    Raises:
        TextureUnreadable: It cannot be opened.
    """
    asset = Ar.GetResolver().OpenAsset(Ar.ResolvedPath(resolved)) if resolved else None
    if not asset:
        raise TextureUnreadable("the texture is missing")
    return bytes(asset.GetBuffer() or b"")  # an empty file has no buffer


def decode_image(data: bytes, space: str = "auto", max_side: int = MAX_SIDE) -> Decoded:
    """An image file's pixels, in 8 bits a channel, and scaled down where it has more than `max_side` a side.

    `auto` means sRGB where the file has 8 bits a channel and three channels or more (UsdPreviewSurface
    specification, Texture Reader). Linear floats are stored sRGB-encoded: 8 linear bits would band.

    Raises:
        TextureUnreadable: No format that can be read, or damaged.
    """
    try:
        if data.startswith(EXR):
            return _decode_exr(data, space, max_side)
        with Image.open(io.BytesIO(data)) as file:
            deep = data.startswith(PNG) and data[_PNG_DEPTH] == 16
            coloured = file.mode in ("RGB", "RGBA", "P", "PA", "CMYK", "YCbCr", "LAB", "RGBX", "RGBa") and not deep
            has_alpha = file.has_transparency_data
            image = (_grey8(file) if file.mode.startswith(("I", "F")) else file).convert("RGBA")
    except MemoryError:
        raise
    except Exception as error:  # decoders raise whatever they stumble over: a palette that is missing is an assertion
        raise TextureUnreadable("the texture cannot be decoded") from error
    return Decoded(_fitted(image, max_side), space == "sRGB" or (space == "auto" and coloured), has_alpha)


def _fitted(image: Image.Image, max_side: int) -> NDArray[np.uint8]:
    """Pixels of an RGBA image, row 0 at the bottom."""
    image.thumbnail((max_side, max_side), Image.Resampling.BOX)
    return np.ascontiguousarray(np.asarray(image, dtype=np.uint8)[::-1])


def _grey8(image: Image.Image) -> Image.Image:
    """A deep grey image in 8 bits; Pillow itself would clip it instead of scaling it."""
    grey = np.asarray(image, dtype=np.float64)
    top = 65535.0 if grey.max(initial=0.0) > 255.0 else 255.0
    return Image.fromarray(_to_bytes(grey / top))


def _to_bytes(values: NDArray[np.floating]) -> NDArray[np.uint8]:
    """Numbers to 0..255, clamped to [0,1] first."""
    return np.asarray(np.floor(np.clip(values, 0.0, 1.0) * 255.0 + 0.5), dtype=np.uint8)


def _decode_exr(data: bytes, space: str, max_side: int) -> Decoded:
    """The first part of an OpenEXR image; values above 1 are clipped, as diffuse reflectance has none.

    Raises:
        ValueError: It has too many pixels, or channels that are no colour.
    """
    with tempfile.NamedTemporaryFile(suffix=".exr") as copy:
        Path(copy.name).write_bytes(data)
        low, high = OpenEXR.File(copy.name, header_only=True).header()["dataWindow"]
        if int(np.prod(np.subtract(high, low, dtype=np.float64) + 1.0)) > LIMITS.texture_pixels:
            raise ValueError("too many pixels")
        channels = OpenEXR.File(copy.name, separate_channels=True).channels()
        planes = {name: np.nan_to_num(np.asarray(c.pixels, dtype=np.float64)) for name, c in channels.items()}
    grey = planes.get("Y", planes.get("R"))
    if grey is None:
        raise ValueError("neither colour nor luminance")
    rgb = np.stack([planes.get(name, grey) for name in "RGB"], axis=-1)
    stored = _to_bytes(rgb if space == "sRGB" else linear_to_srgb(rgb))
    alpha = _to_bytes(planes.get("A", np.ones_like(grey)))
    image = Image.fromarray(np.concatenate((stored, alpha[..., None]), axis=-1), "RGBA")
    return Decoded(_fitted(image, max_side), True, "A" in planes)


def _decode_tiles(file: ImageFile) -> Decoded:
    """UDIM tiles side by side in one image; where a tile is missing it is transparent black."""
    grid = grid_of(number for number, _ in file.tiles)
    side = max(1, 2 * MAX_SIDE // max(grid[2:]))
    tiles = {number: decode_image(read_asset(path), file.space, side) for number, path in file.tiles}
    srgb, has_alpha = (any(flags) for flags in zip(*((t.srgb, t.has_alpha) for t in tiles.values()), strict=True))
    return Decoded(atlas({number: tile.pixels for number, tile in tiles.items()}), srgb, has_alpha, grid)
