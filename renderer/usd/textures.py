"""Images that materials sample: found through the asset resolver, read by Pillow, kept once each."""

from __future__ import annotations

import io
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from pxr import Ar

from schemas.colour import srgb_to_linear
from schemas.scene import Texture, Wrap

MAX_SIDE = 2048
"""Larger images are scaled down to this many pixels a side: views are about that large."""


class TextureUnreadable(Exception):
    """The image is missing or no image that can be decoded."""


@dataclass
class TextureTable:
    """The textures of a scene, each image and way of sampling it once."""

    textures: list[Texture] = field(default_factory=list)
    _index: dict[tuple[str, bool, tuple[Wrap, Wrap], int | None], int] = field(default_factory=dict)
    _images: dict[str, tuple[NDArray[np.uint8], bool]] = field(default_factory=dict)

    def colour(self, resolved: str, name: str, space: str, wrap: tuple[Wrap, Wrap]) -> int:
        """Index of a texture whose RGB is a colour.

        Args:
            resolved: Path that the asset resolver gave, also inside a package (`x.usdz[y.png]`).
            name: For messages.
            space: `sourceColorSpace`: auto, raw or sRGB.
            wrap: Wrap modes.

        Raises:
            TextureUnreadable: There is no such image.
        """
        _, is_colour = self._image(resolved)
        return self._add(resolved, name, space == "sRGB" or (space == "auto" and is_colour), wrap, None)

    def opacity(self, resolved: str, name: str, space: str, wrap: tuple[Wrap, Wrap], channel: int) -> int:
        """Index of a texture one channel of which is an opacity: as `colour`, but the sampler need not decode it."""
        _, is_colour = self._image(resolved)
        srgb = space == "sRGB" or (space == "auto" and is_colour)
        if channel == 3:
            # Alpha is never encoded, so the colour texture of the same image serves.
            return self._add(resolved, name, srgb, wrap, None)
        return self._add(resolved, name, False, wrap, channel) if srgb else self._add(resolved, name, False, wrap, None)

    def channel_range(self, index: int, channel: int) -> tuple[float, float]:
        """Smallest and largest value, in [0,1], of a channel."""
        values = self.textures[index].pixels[..., channel]
        return float(values.min()) / 255.0, float(values.max()) / 255.0

    def _add(self, resolved: str, name: str, srgb: bool, wrap: tuple[Wrap, Wrap], linear: int | None) -> int:
        key = (resolved, srgb, wrap, linear)
        if key not in self._index:
            pixels, _ = self._image(resolved)
            if linear is not None:
                pixels = pixels.copy()
                pixels[..., linear] = np.floor(srgb_to_linear(pixels[..., linear] / 255.0) * 255.0 + 0.5)
            self._index[key] = len(self.textures)
            self.textures.append(Texture(name, pixels, srgb, wrap))
        return self._index[key]

    def _image(self, resolved: str) -> tuple[NDArray[np.uint8], bool]:
        if resolved not in self._images:
            self._images[resolved] = decode_image(read_asset(resolved))
        return self._images[resolved]


def read_asset(resolved: str) -> bytes:
    """The bytes of an asset on disk or inside a package.

    Raises:
        TextureUnreadable: It cannot be opened.
    """
    asset = Ar.GetResolver().OpenAsset(Ar.ResolvedPath(resolved)) if resolved else None
    if not asset:
        raise TextureUnreadable("the texture is missing")
    return bytes(asset.GetBuffer())


def decode_image(data: bytes) -> tuple[NDArray[np.uint8], bool]:
    """Pixels uint8 [h, w, 4], row 0 at the bottom, and whether `auto` means sRGB (8 bits, three channels or more).

    Raises:
        TextureUnreadable: No format that Pillow knows, or damaged.
    """
    try:
        with Image.open(io.BytesIO(data)) as file:
            has_colour = file.mode in ("RGB", "RGBA", "P", "CMYK", "YCbCr", "RGBX", "RGBa")
            image = (_grey8(file) if file.mode.startswith(("I", "F")) else file).convert("RGBA")
        image.thumbnail((MAX_SIDE, MAX_SIDE), Image.Resampling.BOX)
        pixels = np.asarray(image, dtype=np.uint8)
    except (OSError, ValueError, SyntaxError, EOFError, Image.DecompressionBombError) as error:
        raise TextureUnreadable("the texture cannot be decoded") from error
    return np.ascontiguousarray(pixels[::-1]), has_colour


def _grey8(image: Image.Image) -> Image.Image:
    """A deep grey image in 8 bits; Pillow itself would clip it instead of scaling it."""
    grey = np.asarray(image, dtype=np.float64)
    top = 65535.0 if grey.max(initial=0.0) > 255.0 else 255.0
    return Image.fromarray(np.floor(np.clip(grey / top, 0.0, 1.0) * 255.0 + 0.5).astype(np.uint8))
