"""MaterialX documents: plain XML without entities or includes, with relative file names."""

from __future__ import annotations

import io
from xml.etree import ElementTree

from renderer.gate.names import check_reference
from renderer.gate.problems import RejectedScene, shown

MAX_BYTES = 16 << 20
MAX_ELEMENTS = 200_000
MAX_DEPTH = 64
FILE_ATTRIBUTES = ("fileprefix", "href", "file", "source")


def materialx_files(data: bytes, name: str) -> set[str]:
    """The files that a document names.

    Raises:
        RejectedScene: It is damaged, too large, has entities or includes, or names files outside the upload.
    """
    where = shown(name)
    if len(data) > MAX_BYTES:
        raise RejectedScene("scene-too-large", f"{where} has more than {MAX_BYTES} bytes.")
    # In other encodings than UTF-8 a declaration could hide from this search.
    if b"<!" in data.replace(b"<!--", b"") or b"\0" in data or data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        raise RejectedScene("scene-format", f"{where} has a document type, entities or another encoding than UTF-8.")
    if b"encoding" in data[:200] and b"utf-8" not in data[:200].lower():
        raise RejectedScene("scene-format", f"{where} has another encoding than UTF-8.")
    found: set[str] = set()
    depth = count = 0
    try:
        for event, element in ElementTree.iterparse(io.BytesIO(data), ("start", "end")):
            depth += 1 if event == "start" else -1
            count += 1
            if depth > MAX_DEPTH or count > 2 * MAX_ELEMENTS:
                raise RejectedScene("scene-too-large", f"{where} has too many elements, or too deep in each other.")
            if event == "end":
                found.update(_files(element, where))
                element.clear()
    except ElementTree.ParseError as error:
        raise RejectedScene("scene-damaged", f"{where} is no well-formed XML.") from error
    return found


def _files(element: ElementTree.Element, where: str) -> list[str]:
    if element.tag.rsplit("}", 1)[-1].lower() == "include":
        raise RejectedScene("scene-format", f"{where} includes other documents.", "Write everything into one document.")
    named = [value for key, value in element.attrib.items() if key.rsplit("}", 1)[-1] in FILE_ATTRIBUTES]
    if element.get("type") == "filename":
        named += [element.get("value", ""), element.get("default", "")]
    return [check_reference(value, where) for value in named if value]
