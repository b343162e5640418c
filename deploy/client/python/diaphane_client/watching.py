"""`watch`: a bundle that is kept up to date while a renderer runs."""

from __future__ import annotations

import logging
import os
import random
import re
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from diaphane_client.errors import PullError
from diaphane_client.pulling import update

_MOMENT: Final = re.compile(r"\d{4}-\d\d-\d\d \d\d:\d\d:\d\d UTC")

SPREAD: Final = 0.1
"""Waits are longer or shorter by up to this share, so that renderers that started together do not ask together."""

log = logging.getLogger(__name__)


def watch(
    name: str,
    alias: str = "champion",
    *,
    url: str,
    key: str | None,
    folder: str | os.PathLike[str],
    public_key: str | None = None,
    timeout: float = 30.0,
    every: float = 30.0,
    stop: threading.Event | None = None,
) -> Iterator[Path]:
    """The bundle that an alias means: at once as `pull` gives it, then whenever it is another one.

    Whatever goes wrong later is logged, once each time that it changes, and the bundle stays: the iteration ends when
    `stop` is set, or its user leaves it. A question about a version that is the same costs the server one small answer.

    Args:
        name: See `pull`, as for all that is not below.
        alias: Alias.
        url: Where the server is.
        key: API key.
        folder: Where fetched bundles are kept.
        public_key: The server's key.
        timeout: Seconds without a byte after which a connection is given up.
        every: Seconds between two questions, > 0; a tenth more or less, by chance.
        stop: Ends the iteration when it is set, at the latest when the question under way is answered.

    Yields:
        Folder of a complete, verified bundle; its files never change.

    Raises:
        PullError: As `pull`, before there is a first bundle.
        OSError: The folder cannot be written, before there is a first bundle.
        ValueError: `every` is not positive.
    """
    if not every > 0.0:
        raise ValueError("every must be positive")
    stop = stop or threading.Event()
    bundle: Path | None = None
    said = ""
    while not stop.is_set():
        trouble: Exception | None
        try:
            found, trouble = update(
                name,
                alias,
                url=url,
                key=key,
                folder=folder,
                public_key=public_key,
                timeout=timeout,
            )
        except (PullError, OSError) as error:
            if bundle is None:
                raise
            found, trouble = bundle, error
        # Times in it go on, where a clock is wrong at every question: that is no news.
        matter = _MOMENT.sub("", str(trouble or ""))
        if trouble and matter != said:
            log.warning("'%s' %s stays as it is, %s: %s", name, alias, found.name, trouble)
        said = matter
        if found != bundle:
            bundle = found
            yield found
        stop.wait(every * random.uniform(1.0 - SPREAD, 1.0 + SPREAD))
