"""The licence of a scene and whom to name for it, as its root layer states them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final

from pxr import Sdf, Tf

from schemas.licence import tidy

LICENCE_KEYS: Final = ("licence", "license")
CREDIT_KEYS: Final = ("attribution", "copyright", "author", "creator")
"""Names of metadata, in the order in which they are told; case does not matter."""
_DEPTH: Final = 4
"""Of dictionaries in dictionaries, as exporters write `extras` and `asset`."""


def authored_licence(path: Path) -> str:
    """What the root layer's `customLayerData`, or the default prim's `assetInfo` and `customData`, say of its licence.

    Args:
        path: A USD file.

    Returns:
        Licence, then attribution, on one line with semicolons between; empty where nothing is stated.
    """
    try:
        layer = Sdf.Layer.FindOrOpen(str(path))
    except Tf.ErrorException:
        return ""  # whoever loads the scene says why
    if layer is None:
        return ""
    prim = layer.GetPrimAtPath(f"/{layer.defaultPrim}") if layer.defaultPrim else None
    stated: list[Mapping[str, Any]] = [dict(layer.customLayerData)]
    stated += [] if prim is None else [dict(prim.assetInfo), dict(prim.customData)]
    return _licence_of(stated)


def write_licence(layer: Sdf.Layer, asset: object) -> None:
    """Writes into a layer what a glTF file's `asset` says of its licence: `copyright`, and `extras` as exporters do.

    Args:
        layer: That the file is converted to.
        asset: As parsed; whatever is no object says nothing.
    """
    if isinstance(asset, Mapping) and (text := _licence_of([asset])):
        layer.customLayerData = {**layer.customLayerData, LICENCE_KEYS[0]: text}


def _licence_of(stated: list[Mapping[str, Any]]) -> str:
    found: dict[str, str] = {}
    for data in stated:
        for key, text in _texts(data, _DEPTH):
            found.setdefault(key, text)
    parts = [found[key] for key in (*LICENCE_KEYS, *CREDIT_KEYS) if key in found]
    return tidy("; ".join(dict.fromkeys(parts)))


def _texts(data: Mapping[str, Any], depth: int) -> Iterator[tuple[str, str]]:
    """Lower-case key and text of every entry that has one, outer ones first."""
    for key, value in data.items():
        if isinstance(value, str) and (text := tidy(value)):
            yield str(key).lower(), text
    for value in data.values():
        if isinstance(value, Mapping) and depth > 1:
            yield from _texts(value, depth - 1)
