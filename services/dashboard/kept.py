"""What a process keeps in memory of artifacts, within a bound: the least recently used goes first."""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Callable, Hashable
from typing import Any, TypeVar

T = TypeVar("T")


class Kept:
    """Values by key; any number of threads may use it.

    Args:
        bytes_at_most: That all values together may take.
    """

    def __init__(self, bytes_at_most: int) -> None:
        self._most, self._bytes = bytes_at_most, 0
        self._lock = threading.Lock()
        self._values: OrderedDict[Hashable, tuple[Any, int]] = OrderedDict()

    def get(self, key: Hashable, make: Callable[[], T], size: Callable[[T], int]) -> T:
        """The value of a key, made if it is not kept. Two threads may make it at once; one of the two stays.

        Args:
            key: Names the value; it never changes.
            make: Makes it.
            size: Bytes of it.
        """
        with self._lock:
            if key in self._values:
                self._values.move_to_end(key)
                found: T = self._values[key][0]
                return found
        made = make()
        self._keep(key, made, size(made))
        return made

    def _keep(self, key: Hashable, value: object, size: int) -> None:
        with self._lock:
            if key in self._values or size > self._most:
                return
            self._values[key] = value, size
            self._bytes += size
            while self._bytes > self._most:
                _, (_, freed) = self._values.popitem(last=False)
                self._bytes -= freed
