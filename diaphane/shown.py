"""HTML that objects show themselves with: tables and pictures, without styles or scripts of their own."""

from __future__ import annotations

import base64
import io
from collections.abc import Iterable, Sequence
from html import escape
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from services.report import colours


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


def table(headings: Sequence[str], rows: Iterable[Sequence[Any]]) -> str:
    """Rows under headings; None is a dash.

    Args:
        headings: Of the columns.
        rows: Their values.
    """
    head = "".join(f"<th>{escape(heading)}</th>" for heading in headings)
    body = "".join(f"<tr>{''.join(f'<td>{_cell(value)}</td>' for value in row)}</tr>" for row in rows)
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def facts(title: str, pairs: Iterable[tuple[str, Any]]) -> str:
    """A heading over names and values.

    Args:
        title: Plain text.
        pairs: Name and value.
    """
    rows = "".join(f"<tr><th>{escape(name)}</th><td>{_cell(value)}</td></tr>" for name, value in pairs)
    return f"<strong>{escape(title)}</strong><table><tbody>{rows}</tbody></table>"


def paragraphs(sentences: Iterable[str]) -> str:
    """Plain texts, each as a paragraph."""
    return "".join(f"<p>{escape(sentence)}</p>" for sentence in sentences)


def _cell(value: Any) -> str:
    return "–" if value is None else escape(str(value))
