"""Pictures that objects show themselves with in notebooks."""

from __future__ import annotations

import base64
import io
from html import escape

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from evaluation.report import colours


def png(pixels: NDArray[np.uint8]) -> bytes:
    """A picture as a PNG file.

    Args:
        pixels: uint8 [H, W, 3], sRGB, row 0 at the top.
    """
    stream = io.BytesIO()
    Image.fromarray(pixels).save(stream, format="PNG")
    return stream.getvalue()


def figure(pixels: NDArray[np.uint8], caption: str) -> str:
    """A picture with what is under it.

    Args:
        pixels: uint8 [H, W, 3], sRGB, row 0 at the top.
        caption: Plain text.
    """
    said, data = escape(caption), base64.b64encode(png(pixels)).decode("ascii")
    image = f'<img src="data:image/png;base64,{data}" alt="{said}" width="{pixels.shape[1]}">'
    return f'<figure style="margin:0 1em 1em 0;display:inline-block">{image}<figcaption>{said}</figcaption></figure>'


def counts_figure(counts: NDArray[np.integer], most: int, caption: str) -> str:
    """A map of counts, in the colours of the reports.

    Args:
        counts: Integers [H, W], 0 or more.
        most: Count that has the last colour.
        caption: Plain text.
    """
    return figure(colours.apply(counts / max(most, 1), colours.COUNT), f"{caption}; colours: 0 to {most}")
