"""The REST interface: `create_app` over a `Service`."""

from services.api.application import create_app

__all__ = ["create_app"]
