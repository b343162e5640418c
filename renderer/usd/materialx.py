"""Colour and opacity of MaterialX documents that a stage refers to, which this build of USD cannot compose itself."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

from pxr import Sdf, Usd

OPACITY_OF_GLASS = 0.25
"""What alpha blending shows of a surface that transmits all light: its tint, not its refraction."""


@dataclass(frozen=True, slots=True)
class MaterialXSurface:
    """The part of a MaterialX surface that alpha blending can show.

    Attributes:
        colour: Linear RGB, where no image gives it.
        image: File of the base colour, or None.
        opacity: In [0,1].
    """

    colour: tuple[float, float, float]
    image: Path | None
    opacity: float


_INPUTS = {
    "standard_surface": ("base_color", "opacity", "transmission", "transmission_color"),
    "open_pbr_surface": ("base_color", "geometry_opacity", "transmission_weight", "transmission_color"),
    "gltf_pbr": ("base_color", "alpha", "transmission", "attenuation_color"),
    "UsdPreviewSurface": ("diffuseColor", "opacity", "", ""),
}
"""Names of colour, opacity, transmission and its colour, by node category."""


def referenced_document(prim: Usd.Prim) -> Path | None:
    """The .mtlx file that a prim refers to in any of its layers, or None."""
    for spec in prim.GetPrimStack():
        for reference in spec.referenceList.GetAddedOrExplicitItems():
            if str(reference.assetPath).lower().endswith(".mtlx"):
                return Path(Sdf.ComputeAssetPathRelativeToLayer(spec.layer, reference.assetPath))
    return None


def read_surface(document: Path, material: str) -> MaterialXSurface | None:
    """The surface of a named material of a document; None if it is not there or of an unknown kind."""
    root = _parse(document)
    if root is None:
        return None
    shader = _named(root, _input(_named(root, material), "surfaceshader"), "nodename")
    if shader is None or shader.tag not in _INPUTS:
        return None
    colour_name, opacity_name, transmission_name, tint_name = _INPUTS[shader.tag]
    transmission = _numbers(_input(shader, transmission_name), 1, (0.0,))[0]
    opacity = _numbers(_input(shader, opacity_name), 1, (1.0,))[0]
    base = _input(shader, colour_name)
    image = _image(root, base, document.parent)
    colour = _numbers(base, 3, (0.8, 0.8, 0.8) if image is None else (1.0, 1.0, 1.0))
    if transmission > 0.5:
        colour, image = _numbers(_input(shader, tint_name), 3, (1.0, 1.0, 1.0)), None
    opacity *= 1.0 - (1.0 - OPACITY_OF_GLASS) * min(max(transmission, 0.0), 1.0)
    return MaterialXSurface((colour[0], colour[1], colour[2]), image, min(max(opacity, 0.0), 1.0))


def referenced_files(document: Path) -> Iterator[Path]:
    """Every file that a document names, for the scene's digest."""
    root = _parse(document)
    for node in root.iter("input") if root is not None else ():
        if node.get("type") == "filename" and node.get("value"):
            yield document.parent / str(node.get("value"))


def _parse(document: Path) -> ElementTree.Element | None:
    try:
        return ElementTree.parse(document).getroot()
    except (OSError, ElementTree.ParseError):
        return None


def _named(
    root: ElementTree.Element, name: str | ElementTree.Element | None, attribute: str = ""
) -> ElementTree.Element | None:
    """The child of that name, or of the name in an attribute of the given element."""
    wanted = name.get(attribute) if isinstance(name, ElementTree.Element) else name
    return next((child for child in root if child.get("name") == wanted), None) if wanted else None


def _input(node: ElementTree.Element | None, name: str) -> ElementTree.Element | None:
    if node is None or not name:
        return None
    return next((child for child in node if child.tag == "input" and child.get("name") == name), None)


def _numbers(node: ElementTree.Element | None, size: int, default: tuple[float, ...]) -> tuple[float, ...]:
    """The first `size` numbers of an input's value, one number repeated."""
    try:
        values = [float(x) for x in str(node.get("value") if node is not None else "").split(",")]
    except ValueError:
        return default
    return tuple((values * size)[:size]) if len(values) in (1, size) else tuple(values[:size])


def _image(root: ElementTree.Element, node: ElementTree.Element | None, folder: Path) -> Path | None:
    """The file of the image node that an input is connected to, directly or through a node graph's output."""
    if node is None:
        return None
    scope = _named(root, node, "nodegraph")
    if scope is not None:
        source = _named(scope, _named(scope, node, "output"), "nodename")
    else:
        source = _named(root, node, "nodename")
    if source is None or source.tag not in ("image", "tiledimage"):
        return None
    file = _input(source, "file")
    name = file.get("value") if file is not None else None
    return folder / name if name else None
