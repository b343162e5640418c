"""`/v1/datasets`: label shards that a training can learn from."""

from __future__ import annotations

from typing import Any

from fastapi import APIRouter, Response

from schemas.service import DatasetRecord
from services.api.answers import DatasetPage
from services.api.pages import LINK_HEADER, MOMENT, Page
from services.api.parts import BlobHash, DatasetIdPath, Services
from services.api.places import moment
from services.database import tables
from services.problems import Refusal
from stages.desk import SHARD
from stages.store import MissingArtifact

router = APIRouter(prefix="/v1/datasets", tags=["datasets"])

_SHARD: dict[str, Any] = {
    "description": "The shard, safetensors.",
    "content": {"application/octet-stream": {"schema": {"type": "string", "format": "binary"}}},
}


@router.get("", responses={200: {"headers": LINK_HEADER}})
def list_datasets(service: Services, paging: Page) -> DatasetPage:
    """Data sets, newest first."""
    found = service.measured.datasets(paging.fetch, paging.after(MOMENT))

    def place(dataset: DatasetRecord) -> list[float | str]:
        return moment(service.database, tables.datasets, dataset.id, dataset.created)

    return DatasetPage(items=paging.page(found, place))


@router.get("/{dataset_id}")
def read_dataset(dataset_id: DatasetIdPath, service: Services) -> DatasetRecord:
    """A data set."""
    return service.measured.dataset(dataset_id)


@router.get("/{dataset_id}/shards/{sha256}", response_class=Response, responses={200: _SHARD})
def read_shard(dataset_id: DatasetIdPath, sha256: BlobHash, service: Services) -> Response:
    """A label shard of a data set: features and hulls of one view's sampled pixels."""
    shards = service.measured.dataset(dataset_id).shards
    artifact = next((shard.artifact for shard in shards if shard.sha256 == sha256), None)
    if artifact is None:
        raise Refusal("not-found", "The data set has no such shard.")
    try:
        content = service.storage.store.read(artifact, SHARD)
    except MissingArtifact:
        raise Refusal(
            "not-found",
            "The shard was removed because of its age, or is damaged.",
            "Submit the job of the data set again: what is gone is made again.",
        ) from None
    headers = {"ETag": f'"{sha256}"', "Cache-Control": "private, max-age=31536000, immutable"}
    return Response(content, media_type="application/octet-stream", headers=headers)
