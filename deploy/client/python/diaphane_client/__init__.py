"""Fetches published bundles, verified by hash and signature."""

from diaphane_client.errors import Denied, NotFound, PullError, Refused, Unavailable
from diaphane_client.pulling import cached, pull

__all__ = ["Denied", "NotFound", "PullError", "Refused", "Unavailable", "cached", "pull"]
