"""Results on disk: complete or not there."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from schemas.problem import ExitCode, Problem


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """A path to write a file or a folder to, which becomes `path` at the end; folders above it are made.

    What is at `path` stays there if anything goes wrong, and nothing half-written is left.

    Args:
        path: Of the result.

    Yields:
        A path in a new, empty folder beside it, of the same name.

    Raises:
        Problem: It cannot be written.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        work = Path(tempfile.mkdtemp(prefix=".diaphane-", dir=path.parent))
        try:
            made = work / "new" / path.name
            made.parent.mkdir()
            yield made
            if made.is_dir():
                if path.exists():
                    path.rename(work / "old")
                made.rename(path)
            else:
                made.replace(path)
        finally:
            shutil.rmtree(work, ignore_errors=True)
    except OSError as error:
        raise Problem(
            f"{path} cannot be written: {str(error.strerror or error).rstrip('.')}.",
            "Make room, or name another place.",
            ExitCode.TRY_AGAIN,
        ) from error
