"""Names that an upload may use: of its files, and in its layers for other files."""

from __future__ import annotations

import re
import unicodedata

from renderer.gate.problems import RejectedScene, shown

MAX_NAME = 512
"""Characters of a relative name."""
MAX_PARTS = 32
"""Folders in each other."""

_SCHEME = re.compile(r"[A-Za-z][A-Za-z0-9+.-]+:")
_DRIVE = re.compile(r"[A-Za-z]:")
_UP = re.compile(r"(?:\./+)*\.\./+(?:\.{1,2}/+)*")
_ENCODED = re.compile(r"%(2e|2f|5c|00|25|3a)", re.IGNORECASE)
_REFUSED = frozenset('\\:*?"<>|@`[]{}$;')
_PACKAGED = re.compile(r"(?P<package>[^\[\]]+\.usdz)\[(?P<member>[^\[\]]+)\]", re.IGNORECASE)


def check_file_name(name: str, where: str = "The upload") -> str:
    """A relative name of an uploaded file or of a member of a package, as it is.

    Raises:
        RejectedScene: It is absolute, goes up, or has characters that mean something to a resolver.
    """
    if not name or len(name) > MAX_NAME:
        raise RejectedScene("scene-file-name", f"{where} has a file whose name is empty or too long.")
    if name.startswith("/") or _DRIVE.match(name) or ".." in name.split("/"):
        raise RejectedScene("scene-path-outside", f"{where} has a file that lies outside of it.")
    parts = name.split("/")
    if len(parts) > MAX_PARTS or any(part in ("", ".") for part in parts) or _is_deceptive(name):
        raise RejectedScene("scene-file-name", f"{where} has a file with a name that cannot be used: {shown(name)}.")
    return name


def check_reference(path: str, layer: str, depth: int = 0) -> str:
    """A path by which a layer names another file: relative, and inside the upload; without a leading `./`.

    It may begin with `../` as often as the layer lies deep: links are refused, so that is where it leads. Elsewhere in
    it `..` is refused, because a resolver may try such a path against another folder than the layer's.

    Args:
        path: As it is authored; not empty.
        layer: Name of the layer, for messages.
        depth: Folders of the upload that the layer lies in; 0 for one in a package.

    Raises:
        RejectedScene: It could lead anywhere else.
    """
    if "`" in path or "${" in path or path.startswith("$"):
        raise RejectedScene("scene-expression", f"{layer} names a file by an expression.")
    if ":SDF_FORMAT_ARGS:" in path or path.lower().startswith(("anon:", "op:")):
        raise RejectedScene("scene-format", f"{layer} names a file with arguments for its format, or one in memory.")
    if _SCHEME.match(path):
        raise RejectedScene("scene-url", f"{layer} names a file by a URL.")
    clean = path.replace("\\", "/")
    climbs = _UP.match(clean)
    ups = climbs[0].count("..") if climbs else 0
    below = clean[climbs.end() :] if climbs else clean
    if clean.startswith(("/", "~")) or _DRIVE.match(clean) or "\\" in path:
        raise RejectedScene("scene-path-outside", f"{layer} names a file outside the upload.")
    if ups > depth or ".." in re.split(r"[/\[\]]", below):
        raise RejectedScene("scene-path-outside", f"{layer} names a file outside the upload.")
    packaged = _PACKAGED.fullmatch(path)
    for part in packaged.groups() if packaged else (path,):
        inner = "/".join(step for step in part.split("/") if step not in ("", ".", ".."))
        if len(part) > MAX_NAME or not inner or _is_deceptive(inner.replace("<UDIM>", "1001")):
            raise RejectedScene("scene-file-name", f"{layer} names a file in a way that is not understood.")
    return re.sub(r"(^|(?<=[/\[]))(\./+)+", "", path)


def split_package(path: str) -> tuple[str, str | None]:
    """`a.usdz[b.usda]` as package and member; any other path as itself and None."""
    packaged = _PACKAGED.fullmatch(path)
    return (packaged["package"], packaged["member"]) if packaged else (path, None)


def _is_deceptive(name: str) -> bool:
    """Whether a name has control or resolver characters, or becomes another path when it is decoded or normalised."""
    if any(c in _REFUSED or unicodedata.category(c) in ("Cc", "Cf", "Cs", "Co", "Cn", "Zl", "Zp") for c in name):
        return True
    if _ENCODED.search(name):
        return True
    same = unicodedata.normalize("NFKC", name)
    return same != name and (".." in same or any(same.count(c) != name.count(c) for c in "/\\:%"))
