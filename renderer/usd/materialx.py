"""MaterialX documents that a stage refers to, which this build of USD cannot compose itself, as stages of shaders."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree

from pxr import Ar, Sdf, Tf, Usd, UsdShade

Element = ElementTree.Element

_TYPES = {
    "float": Sdf.ValueTypeNames.Float,
    "integer": Sdf.ValueTypeNames.Int,
    "boolean": Sdf.ValueTypeNames.Bool,
    "string": Sdf.ValueTypeNames.String,
    "filename": Sdf.ValueTypeNames.Asset,
    "color3": Sdf.ValueTypeNames.Color3f,
    "color4": Sdf.ValueTypeNames.Color4f,
    "vector2": Sdf.ValueTypeNames.Float2,
    "vector3": Sdf.ValueTypeNames.Float3,
    "vector4": Sdf.ValueTypeNames.Float4,
}
"""USD's types for those of MaterialX; values of other types are left out."""

MATERIAL, GRAPH = "surfacematerial", "nodegraph"


def referenced_material(stage: Usd.Stage, path: Sdf.Path) -> tuple[Path, str] | None:
    """The .mtlx document, and the name in it, of a material that a prim or an ancestor gets by reference; or None."""
    for above in path.GetPrefixes()[::-1]:
        prim = stage.GetPrimAtPath(above)
        for spec in prim.GetPrimStack() if prim else ():
            arcs = (*spec.referenceList.GetAddedOrExplicitItems(), *spec.payloadList.GetAddedOrExplicitItems())
            for arc in arcs:
                if str(arc.assetPath).lower().endswith(".mtlx"):
                    named = Sdf.ComputeAssetPathRelativeToLayer(spec.layer, arc.assetPath)
                    document = Path(str(Ar.GetResolver().Resolve(named)) or named)
                    return document, (arc.primPath.name if above == path else "") or path.name
    return None


def document_stage(document: Path) -> Usd.Stage | None:
    """A document's materials, node graphs and nodes as a stage in memory; None if it cannot be parsed."""
    root = _parse(document)
    return _Converter(root, document).stage() if root is not None else None


def material_named(stage: Usd.Stage, name: str) -> UsdShade.Material | None:
    """A material of a converted document by its name there."""
    material = UsdShade.Material(stage.GetPrimAtPath(Sdf.Path("/").AppendChild(Tf.MakeValidIdentifier(name))))
    return material if material else None


def referenced_files(document: Path) -> Iterator[Path]:
    """Every file that a document names, for the scene's digest."""
    root = _parse(document)
    for top in root if root is not None else ():
        for node in top.iter("input"):
            if node.get("type") == "filename" and node.get("value"):
                yield document.parent / _prefixed(root, top, str(node.get("value")))


def _parse(document: Path) -> Element | None:
    try:
        return ElementTree.parse(document).getroot()
    except (OSError, ElementTree.ParseError):
        return None


def _prefixed(root: Element | None, top: Element, value: str) -> str:
    """A file's name after the `fileprefix` of the root's child it is in, or of the root."""
    return top.get("fileprefix", root.get("fileprefix", "") if root is not None else "") + value


class _Converter:
    """Makes the stage: first all prims, then their inputs, which may name any of them."""

    def __init__(self, root: Element, document: Path) -> None:
        self._root = root
        self._document = document
        self._stage = Usd.Stage.CreateInMemory()

    def stage(self) -> Usd.Stage:
        """The document as a stage."""
        top = Sdf.Path("/")
        for element in self._root:
            self._define(element, top)
            for child in element if element.tag == GRAPH else ():
                self._define(child, _below(top, element))
        for element in self._root:
            self._connect(element, top, element)
            for child in element if element.tag == GRAPH else ():
                self._connect(child, _below(top, element), element)
        return self._stage

    def _define(self, element: Element, parent: Sdf.Path) -> None:
        if not element.get("name") or not (element.get("type") or element.tag == GRAPH) or element.tag in _FIELDS:
            return
        path = _below(parent, element)
        if element.tag == MATERIAL:
            UsdShade.Material.Define(self._stage, path)
        elif element.tag == GRAPH:
            UsdShade.NodeGraph.Define(self._stage, path)
        else:
            shader = UsdShade.Shader.Define(self._stage, path)
            shader.CreateIdAttr(f"ND_{element.tag}_{element.get('type')}")

    def _connect(self, element: Element, parent: Sdf.Path, top: Element) -> None:
        """Values and connections of an element's inputs; a node graph's outputs."""
        if element.tag == "output":
            self._output(element, parent)
            return
        prim = self._stage.GetPrimAtPath(_below(parent, element)) if element.get("name") else None
        if not prim:
            return
        for field in element:
            if field.tag == "input" and field.get("name"):
                self._input(prim, field, parent, top)

    def _output(self, element: Element, graph: Sdf.Path) -> None:
        prim = self._stage.GetPrimAtPath(graph)
        kind = _TYPES.get(str(element.get("type")))
        source = self._source(element, graph)
        if prim and kind is not None and source is not None:
            UsdShade.NodeGraph(prim).CreateOutput(str(element.get("name")), kind).ConnectToSource(source)

    def _input(self, prim: Usd.Prim, field: Element, parent: Sdf.Path, top: Element) -> None:
        name = str(field.get("name"))
        if prim.IsA(UsdShade.Material):
            source = self._source(field, parent)
            if name == "surfaceshader" and source is not None:
                UsdShade.Material(prim).CreateSurfaceOutput().ConnectToSource(source)
            return
        kind = _TYPES.get(str(field.get("type")))
        if kind is None:
            return
        made = UsdShade.ConnectableAPI(prim).CreateInput(name, kind)
        source = self._source(field, parent)
        if source is not None:
            made.ConnectToSource(source)
        elif field.get("value") is not None:
            self._set(made, field, top)

    def _source(self, field: Element, scope: Sdf.Path) -> UsdShade.ConnectionSourceInfo | None:
        """Where an input's or output's value comes from; None where that is no connection, or leads nowhere."""
        if field.get("interfacename"):
            graph = UsdShade.ConnectableAPI(self._stage.GetPrimAtPath(scope))
            given = graph.GetInput(str(field.get("interfacename"))) if graph else None
            return UsdShade.ConnectionSourceInfo(given) if given else None
        name = field.get("nodegraph") or field.get("nodename")
        if not name:
            return None
        above = Sdf.Path("/") if field.get("nodegraph") else scope
        node = UsdShade.ConnectableAPI(self._stage.GetPrimAtPath(above.AppendChild(Tf.MakeValidIdentifier(name))))
        if not node:
            return None
        kind = _TYPES.get(str(field.get("type")), Sdf.ValueTypeNames.Token)
        output = node.CreateOutput(field.get("output") or "out", kind)
        return UsdShade.ConnectionSourceInfo(output)

    def _set(self, made: UsdShade.Input, field: Element, top: Element) -> None:
        text = str(field.get("value"))
        kind = field.get("type")
        if kind == "filename":
            file = self._document.parent / _prefixed(self._root, top, text)
            made.Set(Sdf.AssetPath(str(file)))
            space = field.get("colorspace") or top.get("colorspace") or self._root.get("colorspace")
            made.GetAttr().SetColorSpace(space or "")
        elif kind in ("string", "boolean"):
            made.Set(text if kind == "string" else text == "true")
        else:
            size = int(str(kind)[-1]) if str(kind)[-1].isdigit() else 1
            numbers = _numbers(text, size)
            if numbers is not None:
                made.Set(numbers if size > 1 else numbers[0])


_FIELDS = ("input", "output", "look", "nodedef", "materialassign")
"""Elements that are no nodes."""


def _below(parent: Sdf.Path, element: Element) -> Sdf.Path:
    return parent.AppendChild(Tf.MakeValidIdentifier(str(element.get("name"))))


def _numbers(text: str, size: int) -> tuple[float, ...] | None:
    """The `size` numbers of a value, one number repeated; None if they are not that many."""
    try:
        values = [float(x) for x in text.split(",")]
    except ValueError:
        return None
    values = values * size if len(values) == 1 else values
    return tuple(values) if len(values) == size else None
