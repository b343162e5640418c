"""The workflows that run in this process now."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from services.engine.states import Abandoned


class Claims:
    """Who holds what; safe for threads."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._held: dict[str, Callable[[], None] | None] = {}
        self._lost: set[str] = set()
        self.draining = threading.Event()
        """Set when the process is to end: jobs are left to others, tasks are finished."""

    @contextmanager
    def hold(self, workflow_id: str) -> Iterator[None]:
        """For as long as the workflow runs here.

        Raises:
            Abandoned: It runs here already: a claim that was lost and came back while its first run still ends.
        """
        with self._lock:
            if workflow_id in self._held:
                raise Abandoned(workflow_id)
            self._held[workflow_id] = None
            self._lost.discard(workflow_id)
        try:
            yield
        finally:
            with self._lock:
                del self._held[workflow_id]
                self._lost.discard(workflow_id)

    def held(self) -> set[str]:
        """Ids of all."""
        with self._lock:
            return set(self._held)

    def on_loss(self, workflow_id: str, act: Callable[[], None] | None) -> None:
        """What is done when the claim is lost; at once if it is lost already."""
        with self._lock:
            self._held[workflow_id] = act
            lost = workflow_id in self._lost
        if lost and act is not None:
            act()

    def lose(self, workflow_ids: set[str]) -> None:
        """Tells that claims are lost."""
        with self._lock:
            found = workflow_ids & set(self._held)
            self._lost |= found
            acts = [self._held[workflow_id] for workflow_id in found]
        for act in acts:
            if act is not None:
                act()

    def check(self, workflow_id: str) -> None:
        """Raises `Abandoned` if the claim is lost."""
        with self._lock:
            lost = workflow_id in self._lost
        if lost:
            raise Abandoned(workflow_id)
