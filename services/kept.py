"""What a process keeps in memory, within a bound: the least recently used goes first."""

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
        found: T | None = self.find(key)
        if found is not None:
            return found
        made = make()
        self.keep(key, made, size(made))
        return made

    def find(self, key: Hashable) -> Any:
        """The value of a key; None if it is not kept."""
        with self._lock:
            if key not in self._values:
                return None
            self._values.move_to_end(key)
            return self._values[key][0]

    def keep(self, key: Hashable, value: object, size: int) -> None:
        """Keeps a value, unless its key has one or it is larger than all may be together.

        Args:
            key: Names it.
            value: Not None.
            size: Bytes of it.
        """
        with self._lock:
            if key in self._values or size > self._most:
                return
            self._values[key] = value, size
            self._bytes += size
            while self._bytes > self._most:
                _, (_, freed) = self._values.popitem(last=False)
                self._bytes -= freed

    def drop(self, key: Hashable) -> None:
        """Forgets the value of a key, if there is one."""
        with self._lock:
            _, freed = self._values.pop(key, (None, 0))
            self._bytes -= freed
