"""Materials as trimesh reads them, of glTF and of OBJ, as looks that are written to USD; their images as PNG."""

from __future__ import annotations

import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from PIL import Image as PillowImage
from trimesh.visual.material import PBRMaterial

from renderer.authoring import Image, Look


class Looks:
    """Makes looks, and writes each image once.

    Args:
        source: Folder that names of images are relative to.
        folder: Folder of the stage.
        textures: Name of the folder of images in it.
        warn: Is told what is left out.
    """

    def __init__(self, source: Path, folder: Path, textures: str, warn: Callable[[str], None]) -> None:
        self._source, self._folder, self._textures, self._warn = source, folder, textures, warn
        self._images: dict[bytes, str] = {}

    @property
    def images(self) -> int:
        """How many were written."""
        return len(self._images)

    def look_of(self, material: Any, has_uv: bool) -> Look:
        """The look of a trimesh material.

        Args:
            material: A PBRMaterial or SimpleMaterial.
            has_uv: Whether there are texture coordinates; without them images are left out.
        """
        return self._pbr(material, has_uv) if isinstance(material, PBRMaterial) else self._simple(material, has_uv)

    def _pbr(self, material: Any, has_uv: bool) -> Look:
        """A glTF material."""
        base = _rgba(material.baseColorFactor)
        mode = material.alphaMode or "OPAQUE"
        image = self.image(material.baseColorTexture) if has_uv and material.baseColorTexture is not None else None
        cutoff = float(0.5 if material.alphaCutoff is None else material.alphaCutoff) if mode == "MASK" else None
        return Look(base=base, image=image, is_opaque=mode == "OPAQUE", cutoff=cutoff)

    def _simple(self, material: Any, has_uv: bool) -> Look:
        """An OBJ material: `d` or `Tr` is its opacity, and `map_d` an image of it."""
        given = {key.lower(): value for key, value in material.kwargs.items()}
        red, green, blue, alpha = _rgba(material.diffuse)
        if len(given.get("kd", ())) == 3:  # with all digits
            red, green, blue = (float(value) for value in given["kd"])
        for key in ("d", "tr"):
            try:
                value = float(given[key][-1])
            except (KeyError, TypeError, ValueError, IndexError):
                continue
            alpha = value if key == "d" else 1.0 - value
            break
        mask = None
        if has_uv and "map_d" in given:
            mask = self._mask(" ".join(str(part) for part in given["map_d"]))
        image = self.image(material.image) if has_uv and material.image is not None else None
        if image is not None and "kd" not in given:
            red = green = blue = 1.0
        alpha = min(max(alpha, 0.0), 1.0)
        opaque = mask is None and alpha >= 1.0
        # An image's own alpha counts only where the file says so, with map_d.
        return Look((red, green, blue, alpha), image, mask, is_image_alpha=False, is_opaque=opaque)

    def _mask(self, name: str) -> tuple[Image, str] | None:
        path = self._source / name.replace("\\", "/")
        try:
            with PillowImage.open(path) as image:
                return self.image(image), "a" if image.mode in ("RGBA", "LA", "PA") else "r"
        except OSError:
            self._warn(f"the opacity image {name} cannot be read, and is left out")
            return None

    def image(self, image: Any) -> Image:
        """Writes a Pillow image once."""
        kept = image if image.mode in ("L", "LA", "RGB", "RGBA") else image.convert("RGBA")
        key = kept.mode.encode() + struct.pack("<II", *kept.size) + kept.tobytes()
        if key not in self._images:
            folder = self._folder / self._textures
            folder.mkdir(exist_ok=True)
            name = f"image{len(self._images)}.png"
            kept.save(folder / name)
            self._images[key] = f"./{self._textures}/{name}"
        return Image(self._images[key])


def is_invented(material: Any) -> bool:
    """Whether trimesh made the material up, with an image of its own, since the file has texture coordinates only."""
    if isinstance(material, PBRMaterial) or material.kwargs:
        return False
    return material.image is None or material.image.format is None


def _rgba(colour: Any) -> tuple[float, float, float, float]:
    """Linear RGBA of a material's 8-bit colour; white where it has none."""
    if colour is None:
        return 1.0, 1.0, 1.0, 1.0
    values = (np.asarray(trimesh.visual.to_rgba(colour), dtype=np.float64) / 255.0).tolist()
    return values[0], values[1], values[2], values[3]
