"""Fetches published bundles, verified by hash and signature, keeps them up to date, and runs them on numpy."""

from diaphane_client.allocation import Cuts, allocate, importance_curve
from diaphane_client.errors import Denied, NotFound, PullError, Refused, Unavailable
from diaphane_client.predictor import Predictor
from diaphane_client.pulling import cached, forget, pull
from diaphane_client.watching import watch

__all__ = [
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
    "importance_curve",
    "pull",
    "watch",
]
