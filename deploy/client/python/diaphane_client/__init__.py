"""Fetches published bundles, verified by hash and signature, keeps them up to date, and runs them on numpy."""

from diaphane_client.allocation import Cuts, allocate
from diaphane_client.errors import Denied, NotFound, PullError, Refused, Unavailable
from diaphane_client.predictor import Predictor
from diaphane_client.prices import Bins
from diaphane_client.pulling import cached, forget, pull
from diaphane_client.watching import watch

__all__ = [
    "Bins",
    "Cuts",
    "Denied",
    "NotFound",
    "Predictor",
    "PullError",
    "Refused",
    "Unavailable",
    "allocate",
    "cached",
    "forget",
    "pull",
    "watch",
]
