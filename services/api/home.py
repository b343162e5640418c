"""`/`: a page that says what this is, without script."""

from __future__ import annotations

import base64
import hashlib

from fastapi import APIRouter, Response

router = APIRouter(tags=["pages"])

_STYLE = (
    "body{font:1rem/1.6 system-ui,sans-serif;max-width:42rem;margin:4rem auto;padding:0 1rem;color:#1b1f24;"
    "background:#fff}code{background:#eef1f4;padding:.1em .3em;border-radius:3px}a{color:#0b57d0}"
    "@media(prefers-color-scheme:dark){body{color:#e6e8eb;background:#14171a}code{background:#262b31}a{color:#8ab4f8}}"
)
_PAGE = f"""<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>Diaphane</title>
<style>{_STYLE}</style>
</head>
<body>
<main>
<h1>Diaphane</h1>
<p>Learns where a renderer should spend a fixed budget of transparent fragments, and serves the result as signed
bundles.</p>
<p>This is its service. It is used with the command <code>diaphane</code> and an API key:</p>
<pre><code>export DIAPHANE_URL=... DIAPHANE_KEY=...
diaphane jobs list</code></pre>
<ul>
<li><a href="/v1/openapi.json">The interface</a> (OpenAPI)</li>
<li><a href="/v1/problems">What its errors mean</a></li>
<li><a href="/v1/health/ready">Whether it is ready</a></li>
</ul>
</main>
</body>
</html>
"""
_HASH = base64.b64encode(hashlib.sha256(_STYLE.encode()).digest()).decode()
_POLICY = (
    f"default-src 'none'; style-src 'sha256-{_HASH}'; img-src 'self'; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'"
)


@router.get("/", response_class=Response, responses={200: {"content": {"text/html": {"schema": {"type": "string"}}}}})
async def read_home() -> Response:
    """The page."""
    headers = {"Content-Security-Policy": _POLICY, "Cache-Control": "no-cache"}
    return Response(_PAGE, media_type="text/html", headers=headers)
