"""A server's REST interface as Python calls: what the commands that talk to a server use, and `diaphane.Client`."""

from diaphane.client.client import Client
from diaphane.client.records import Record, Records

__all__ = ["Client", "Record", "Records"]
