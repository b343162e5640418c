"""A server as Python calls."""

from __future__ import annotations

from typing import Self

from diaphane import shown
from diaphane.client.datasets import Datasets
from diaphane.client.group import Group
from diaphane.client.jobs import Jobs
from diaphane.client.keys import Keys
from diaphane.client.models import Models
from diaphane.client.records import Record, Records
from diaphane.client.scenes import Scenes
from diaphane.client.transport import Transport
from diaphane.client.webhooks import Webhooks


class Client(Group):
    """A server.

    Args:
        url: Where it is, `http://host:port` or `https://...`.
        key: API key; None: requests go without.
        patience: `patience` and `first_patience` of `Transport`, seconds.

    Attributes:
        scenes: Upload, list, check.
        jobs: Submit, follow, cancel, retry.
        models: Versions, aliases, verified downloads.
        datasets: Label shards that trainings learn from.
        keys: Who may ask.
        webhooks: Who hears of what happens.

    Raises:
        Problem: The URL is not one, or carries a password.
    """

    def __init__(self, url: str, key: str | None = None, **patience: float) -> None:
        super().__init__(Transport(url, key, **patience))
        self.url = self._transport.url
        self.scenes = Scenes(self._transport)
        self.jobs = Jobs(self._transport)
        self.models = Models(self._transport, key)
        self.datasets = Datasets(self._transport)
        self.keys = Keys(self._transport)
        self.webhooks = Webhooks(self._transport)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Closes the connections."""
        self._transport.close()

    def measurements(self, limit: int | None = None, **filters: str | float | None) -> Records:
        """Measurements by scene, technique, budget, model, job, since, until."""
        return self._items("/v1/measurements", filters, limit)

    def workers(self) -> Record:
        """Queues, and the processes that run work."""
        return self._ask("GET", "/v1/workers")

    def __repr__(self) -> str:
        return f"<Client {self.url}>"

    def _repr_html_(self) -> str:
        return shown.facts("Diaphane", [("server", self.url)])
