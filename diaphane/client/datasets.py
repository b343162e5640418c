"""Data sets of a server."""

from __future__ import annotations

from diaphane.client.group import Group, segment
from diaphane.client.records import Record, Records


class Datasets(Group):
    """Data sets of a server."""

    def get(self, dataset_id: str) -> Record:
        """A data set."""
        return self._ask("GET", f"/v1/datasets/{segment(dataset_id)}")

    def list(self, limit: int | None = None) -> Records:
        """Data sets, newest first."""
        return self._items("/v1/datasets", limit=limit)
