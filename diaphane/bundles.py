"""The folder of a bundle, however it is named."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def bundle_folder(bundle: str | None, state: Path) -> Iterator[Path | None]:
    """Folder of the bundle that was asked for: one on disk, or one of the registry; None if none was.

    Args:
        bundle: A folder, or NAME@ALIAS.
        state: Folder of the registry.
    """
    if bundle is None or Path(bundle).is_dir():
        yield None if bundle is None else Path(bundle)
        return
    # A folder needs no database.
    from diaphane.local.state import open_local

    with open_local(state) as local:
        yield local.registry.folder(local.registry.resolve(bundle))
