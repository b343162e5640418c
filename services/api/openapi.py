"""`python -m services.api.openapi` writes `docs/openapi.json` anew."""

from __future__ import annotations

from pathlib import Path

from services.api.description import document_text

FILE = Path(__file__).resolve().parents[2] / "docs" / "openapi.json"

if __name__ == "__main__":
    FILE.write_text(document_text(), encoding="utf-8")
