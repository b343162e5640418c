"""A stand-in for the check of a scene: it tells what a child sees."""

from __future__ import annotations

import json
import os
from pathlib import Path


def inspect(folder: Path, root: str) -> dict[str, str]:
    """The content of every path that `root` lists, or the error that it ends with; where the child works."""
    found = {"cwd": str(Path.cwd()), "search": os.environ.get("PXR_AR_DEFAULT_SEARCH_PATH", "")}
    for path in json.loads(root):
        try:
            found[path] = Path(path).read_text()
        except OSError as error:
            found[path] = type(error).__name__
    return found
