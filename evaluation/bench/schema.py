"""`python -m evaluation.bench.schema` writes `docs/bench.schema.json` anew."""

from __future__ import annotations

import json
import sys
from pathlib import Path

from schemas.bench import BenchResult

FILE = Path(__file__).resolve().parents[2] / "docs" / "bench.schema.json"


def schema_text() -> str:
    """JSON schema of `bench.json`, as it is committed."""
    schema = {"$schema": "https://json-schema.org/draft/2020-12/schema", **BenchResult.model_json_schema()}
    return json.dumps(schema, indent=1) + "\n"


def main() -> int:
    """Write the file."""
    FILE.write_text(schema_text(), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
