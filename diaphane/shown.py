"""HTML that objects show themselves with in notebooks, without styles or scripts of their own."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape
from typing import Any


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
