"""Where artifacts and blobs lie: a folder, or an object store with a local cache in front of it."""

from __future__ import annotations

from services.storage.blobs import Blobs, MissingBlob
from services.storage.opening import Storage, open_storage

__all__ = ["Blobs", "MissingBlob", "Storage", "open_storage"]
