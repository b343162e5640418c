"""Style and scripts of the pages: a few vendored and own files, under addresses that change with their content."""

from __future__ import annotations

import hashlib
from functools import cache
from pathlib import Path
from typing import Annotated

from fastapi import APIRouter, Request, Response
from fastapi import Path as InPath
from markupsafe import Markup

from evaluation.report.colours import COUNT, HEAT, css_gradient
from evaluation.report.page import TEMPLATES
from evaluation.report.vega import DRAWING, FOLDER, RUNTIME
from services.api.etags import is_current
from services.problems import Refusal

HTMX = "2.0.11"
"""Version of the vendored htmx (https://htmx.org, Zero-Clause BSD); `htmx.min.js` is as released."""
IDIOMORPH = "0.8.0"
"""Version of the vendored idiomorph, htmx's morphing swap (https://github.com/bigskysoftware/idiomorph, Zero-Clause
BSD); `idiomorph-ext.min.js` is as released."""

router = APIRouter(prefix="/static", include_in_schema=False)

_FOLDER = Path(__file__).resolve().parent / "static"
_SOURCES: dict[str, tuple[str, tuple[Path, ...]]] = {
    # Colours, tables and charts are those of the reports.
    "dashboard.css": ("text/css", (TEMPLATES / "report.css", _FOLDER / "dashboard.css", _FOLDER / "compare.css")),
    "dashboard.js": ("text/javascript", (_FOLDER / "dashboard.js",)),
    "compare.js": ("text/javascript", (_FOLDER / "compare.js",)),
    "htmx.min.js": ("text/javascript", (_FOLDER / "htmx.min.js",)),
    "htmx.LICENSE.txt": ("text/plain", (_FOLDER / "htmx.LICENSE.txt",)),
    "idiomorph-ext.min.js": ("text/javascript", (_FOLDER / "idiomorph-ext.min.js",)),
    "idiomorph.LICENSE.txt": ("text/plain", (_FOLDER / "idiomorph.LICENSE.txt",)),
    **{name: ("text/javascript", (FOLDER / name,)) for name in (*RUNTIME, DRAWING)},
    "vega.LICENSE.txt": ("text/plain", (FOLDER / "LICENSE.txt",)),
    "icon.svg": ("image/svg+xml", (_FOLDER / "icon.svg",)),
}
"""Name -> media type, and the files that it is made of."""


@cache
def content(name: str) -> tuple[bytes, str]:
    """A file, and the hex sha256 of its content."""
    made = b"\n".join(path.read_bytes() for path in _SOURCES[name][1])
    if name == "dashboard.css":
        for kind, anchors in (("count", COUNT), ("heat", HEAT)):
            made += f".ramp .{kind} {{ background: {css_gradient(anchors)}; }}\n".encode()
    return made, hashlib.sha256(made).hexdigest()


def address(name: str) -> str:
    """Where a page finds a file."""
    return f"/static/{content(name)[1][:16]}/{name}"


def charts_script() -> Markup:
    """What a page with charts has in its head; Vega itself is fetched with the first chart."""
    return Markup('<script src="{}" data-runtime="{}" defer></script>').format(
        address(DRAWING), " ".join(map(address, RUNTIME))
    )


@router.get("/{digest}/{name}", response_class=Response)
def read_asset(
    digest: Annotated[str, InPath(pattern=r"^[0-9a-f]{16}$")],
    name: Annotated[str, InPath(pattern=r"^[A-Za-z.-]{1,40}$")],
    request: Request,
) -> Response:
    """A file; what has an address never changes."""
    if name not in _SOURCES or address(name) != request.scope["path"]:
        raise Refusal("not-found")
    made, tag = content(name)
    headers = {"ETag": f'"{tag}"', "Cache-Control": "public, max-age=31536000, immutable"}
    if is_current(request, tag):
        return Response(status_code=304, headers=headers)
    return Response(made, media_type=_SOURCES[name][0], headers=headers)
