"""Which storage a URL means."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from schemas.problem import Problem
from services.settings import Settings
from services.storage.blobs import Blobs
from stages.store import Store


@dataclass(frozen=True)
class Storage:
    """Artifacts and blobs of a service."""

    store: Store
    blobs: Blobs


def open_storage(settings: Settings, patience: float = 20.0) -> Storage:
    """Opens the storage that `settings.store_url` names.

    `s3://bucket/prefix` is any S3-compatible object store, with a cache in `settings.cache_folder`: credentials, region
    and endpoint come from `AWS_*`; an endpoint may be plain HTTP if `AWS_ENDPOINT_URL` says so. Everything else is a
    folder, which workers on several machines may share.

    Args:
        settings: Of the service.
        patience: Seconds for which a request to an object store that does not answer is repeated: who works waits,
            who is asked says so.

    Raises:
        Problem: The URL is not understood.
        OSError: The folder cannot be made.
    """
    url = settings.store_url
    if url.startswith("s3://"):
        # Imported late: a folder needs no object store's client.
        from services.storage.remote import Remote
        from services.storage.tiered import TieredBlobs, TieredStore

        remote = Remote.open(url, patience)
        return Storage(TieredStore(settings.cache_folder, remote), TieredBlobs(settings.cache_folder, remote))
    if "://" in url and not url.startswith("file:///"):
        raise Problem(
            f"A store URL that begins with '{url.partition(':')[0]}:' is not understood.",
            "Set DIAPHANE_STORE to a folder or to s3://BUCKET/PREFIX.",
        )
    root = Path(url.removeprefix("file://"))
    return Storage(Store(root), Blobs(root))
