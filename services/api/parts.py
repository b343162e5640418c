"""What many routes take: the service, ids in paths, texts in queries."""

from __future__ import annotations

from typing import Annotated

from fastapi import Depends, Path, Query, Request

from services.service import Service


async def _service(request: Request) -> Service:
    service: Service = request.app.state.service
    return service


Services = Annotated[Service, Depends(_service)]

JobId = Annotated[str, Path(pattern=r"^job_[0-9a-f]{24}$")]
SceneIdPath = Annotated[str, Path(pattern=r"^scn_[0-9a-f]{32}$")]
DatasetIdPath = Annotated[str, Path(pattern=r"^dst_[0-9a-f]{32}$")]
UploadId = Annotated[str, Path(pattern=r"^upl_[0-9a-f]{24}$")]
WebhookId = Annotated[str, Path(pattern=r"^whk_[0-9a-f]{24}$")]
KeyId = Annotated[str, Path(pattern=r"^key_[0-9a-f]{12}$")]
BlobHash = Annotated[str, Path(pattern=r"^[0-9a-f]{64}$")]
NamePath = Annotated[str, Path(pattern=r"^[a-z0-9](?:[a-z0-9-]{0,61}[a-z0-9])?$")]
AliasPath = Annotated[str, Path(pattern=r"^[a-z](?:[a-z0-9-]{0,38}[a-z0-9])?$")]
VersionPath = Annotated[str, Path(pattern=r"^[A-Za-z0-9][A-Za-z0-9.-]{0,39}$")]

PRINTED = r"^[^\x00-\x1f\x7f]*$"
"""Texts of one line without control characters."""

Text = Annotated[str, Query(min_length=1, max_length=200, pattern=PRINTED)]
"""A text in a query; databases take no NUL."""

NameQuery = Annotated[str | None, Query(pattern=r"^[a-z0-9](?:[a-z0-9-]{0,61}[a-z0-9])?$")]
"""Name of a bundle."""
