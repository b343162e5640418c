"""Pictures of a comparison: a side as stored, its k as a heat map, and how two sides differ."""

from __future__ import annotations

import io

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from evaluation.pictures import read_png
from evaluation.report import colours
from renderer.reference.flip import flip
from services.dashboard.pixels import counts_of
from services.dashboard.sides import Side
from services.kept import Kept
from stages.store import Store


class Picturing:
    """Makes pictures, and keeps those that took a while.

    Args:
        store: Where artifacts lie.
        kept: Where pictures are kept.
    """

    def __init__(self, store: Store, kept: Kept) -> None:
        self._store, self._kept = store, kept

    def stored(self, side: Side, file: str) -> bytes:
        """A file of a side's artifact.

        Raises:
            MissingArtifact: The artifact is gone.
            FileNotFoundError: It has no such file.
        """
        return self._store.read(side.shot.artifact, file)

    def counts(self, side: Side, top: int) -> bytes:
        """PNG of a side's k, by the square root.

        Args:
            side: One with a map of k.
            top: Where the scale ends.

        Raises:
            MissingArtifact: As `stored`.
            FileNotFoundError: As `stored`.
        """
        if side.counts is None:
            raise FileNotFoundError("there is no map of k")
        k = counts_of(self._store, self._kept, side.shot.artifact, side.counts)
        return _png(colours.apply(np.sqrt(k / np.float32(top)), colours.COUNT))

    def difference(self, a: Side, b: Side, factor: int) -> bytes:
        """PNG of |A - B| of the displayed values, amplified.

        Args:
            a: A side.
            b: Another one.
            factor: What differences are multiplied with.

        Raises:
            MissingArtifact: As `stored`.
            FileNotFoundError: As `stored`.
        """
        one, two = (self._image(side).astype(np.int32) for side in (a, b))
        return _png(np.minimum(np.abs(one - two) * factor, 255).astype(np.uint8))

    def flip(self, a: Side, b: Side) -> bytes:
        """PNG of the FLIP map of the two, by the square root, so that small errors can be told apart.

        Args:
            a: The reference, unless B is exact.
            b: What is compared with it.

        Raises:
            MissingArtifact: As `stored`.
            FileNotFoundError: As `stored`.
        """
        key = ("flip", *((side.shot.artifact, side.picture) for side in (a, b)))
        return self._kept.get(key, lambda: self._flip(a, b), len)

    def _flip(self, a: Side, b: Side) -> bytes:
        reference, test = (b, a) if b.is_exact else (a, b)
        if reference.is_exact and not test.is_exact:  # it was compared with that one when it was evaluated
            stored = read_png(io.BytesIO(self.stored(test, f"{test.shot.stem}.flip.png")))
            error = stored.astype(np.float32) / np.float32(255.0)
        else:
            error = flip(self._image(test), self._image(reference))
        return _png(colours.apply(np.sqrt(error), colours.HEAT))

    def _image(self, side: Side) -> NDArray[np.uint8]:
        """uint8 [H, W, 3]; grey pictures as three equal channels."""
        with Image.open(io.BytesIO(self.stored(side, side.picture))) as image:
            return np.asarray(image.convert("RGB"))


def _png(pixels: NDArray[np.uint8]) -> bytes:
    stream = io.BytesIO()
    Image.fromarray(pixels).save(stream, format="PNG", compress_level=1)
    return stream.getvalue()
