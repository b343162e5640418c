"""Models of a server: published bundles, their versions and aliases."""

from __future__ import annotations

from pathlib import Path

from diaphane.client.group import Group, segment
from diaphane.client.records import Record, Records
from diaphane.client.transport import Transport
from evaluation.viewer.pulling import FETCHED, pull


class Models(Group):
    """Published bundles of a server.

    Args:
        transport: How it is reached.
        key: API key, which downloads are asked for with; None: none.
    """

    def __init__(self, transport: Transport, key: str | None) -> None:
        super().__init__(transport)
        self._key = key

    def list(self) -> Records:
        """All names of the registry."""
        return self._items("/v1/models")

    def versions(self, name: str) -> Records:
        """The versions of a name."""
        return self._items(f"/v1/models/{segment(name)}/versions")

    def get(self, name: str, selector: str = "champion") -> Record:
        """A version by number or alias."""
        return self._ask("GET", f"/v1/models/{segment(name)}/versions/{segment(selector)}")

    def aliases(self, name: str) -> Record:
        """Aliases of a name and the history of their moves."""
        return self._ask("GET", f"/v1/models/{segment(name)}/aliases")

    def move_alias(self, name: str, alias: str, version: str, reason: str) -> Record:
        """Points an alias at a version."""
        path = f"/v1/models/{segment(name)}/aliases/{segment(alias)}"
        return self._ask("PUT", path, json={"version": version, "reason": reason})

    def roll_back(self, name: str, alias: str, reason: str) -> Record:
        """Points an alias at the version that it meant before."""
        path = f"/v1/models/{segment(name)}/aliases/{segment(alias)}/rollback"
        return self._ask("POST", path, json={"reason": reason}, repeatable=False)

    def pull(self, name: str, alias: str = "champion", folder: str | Path = Path(".diaphane") / FETCHED) -> Path:
        """Fetches what an alias means, with everything that the Python client verifies.

        Args:
            name: Of the bundle.
            alias: Which version: the one that this alias points at.
            folder: Where bundles are kept.

        Returns:
            Folder of the bundle.

        Raises:
            Problem: The client is not installed, or there is no such bundle, or it is not what was signed.
        """
        return pull(name, alias, self._transport.url, self._key, Path(folder))
