"""`/v1/metrics`: what Prometheus reads. Requests are counted here; the rest is asked of the database at each read."""

from __future__ import annotations

from collections.abc import Iterator

import sqlalchemy as sa
import structlog
from fastapi import APIRouter, Request, Response
from prometheus_client import CollectorRegistry, Counter, Histogram, disable_created_metrics, generate_latest
from prometheus_client.core import GaugeMetricFamily, Metric
from prometheus_client.exposition import CONTENT_TYPE_LATEST
from prometheus_client.registry import Collector

from schemas.job import JobState
from schemas.webhook import DELIVERY_STATES
from services.api.feeds import Feeds
from services.database.tables import jobs
from services.service import Service
from stages.tasks import ROLES

router = APIRouter(prefix="/v1/metrics", tags=["health"])
log = structlog.get_logger("diaphane.metrics")

_STATES: tuple[JobState, ...] = ("queued", "running", "cancelling", "cancelled", "succeeded", "failed")
_SECONDS = (0.002, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 5.0, 10.0, 30.0)


class Metrics:
    """The metrics of one application.

    Args:
        service: What is asked at each read.
        feeds: Whose listeners are counted.
    """

    def __init__(self, service: Service, feeds: Feeds) -> None:
        self.registry = CollectorRegistry()
        disable_created_metrics()  # type: ignore[no-untyped-call]  # they double the text and tell nothing
        names = ["method", "route"]
        self._requests = Counter(
            "diaphane_http_requests", "Requests answered.", [*names, "status"], registry=self.registry
        )
        self._seconds = Histogram(
            "diaphane_http_request_seconds",
            "Time until an answer begins.",
            names,
            buckets=_SECONDS,
            registry=self.registry,
        )
        self._bytes = Counter("diaphane_http_response_bytes", "Bytes of bodies sent.", names, registry=self.registry)
        self.registry.register(_Found(service, feeds))

    def count(self, method: str, route: str, status: int, seconds: float, size: int) -> None:
        """Counts a request; `route` is the template, so that addresses do not become names of metrics."""
        self._requests.labels(method, route, str(status)).inc()
        self._seconds.labels(method, route).observe(seconds)
        self._bytes.labels(method, route).inc(size)


class _Found(Collector):
    def __init__(self, service: Service, feeds: Feeds) -> None:
        self._service, self._feeds = service, feeds

    def describe(self) -> Iterator[Metric]:
        """Nothing: so that registering asks nothing of the database."""
        return iter(())

    def collect(self) -> Iterator[Metric]:
        """What there is now; only whether the database answers, if it does not."""
        yield GaugeMetricFamily("diaphane_event_listeners", "Clients that listen to events.", self._feeds.listeners)
        try:
            found = list(self._of_database())
        except Exception as error:
            log.warning("metrics are incomplete", error=type(error).__name__)
            found = []
        yield GaugeMetricFamily("diaphane_database_up", "Whether the database answers.", float(bool(found)))
        yield from found

    def _of_database(self) -> Iterator[Metric]:
        waiting = GaugeMetricFamily("diaphane_queue_depth", "Tasks that wait, by role.", labels=["role"])
        running = GaugeMetricFamily("diaphane_queue_running", "Tasks under way, by role.", labels=["role"])
        for queue in self._service.jobs.queues():
            waiting.add_metric([queue.role], queue.queued)
            running.add_metric([queue.role], queue.running)
        states = GaugeMetricFamily("diaphane_jobs", "Jobs by state.", labels=["state"])
        count = sa.select(jobs.c.state, sa.func.count()).group_by(jobs.c.state)
        with self._service.database.read() as connection:
            counts = {state: int(number) for state, number in connection.execute(count)}
        for state in _STATES:
            states.add_metric([state], counts.get(state, 0))
        alive = [executor.roles for executor in self._service.jobs.executors() if executor.alive]
        executors = GaugeMetricFamily("diaphane_executors_alive", "Living workers, by role.", labels=["role"])
        for role in ROLES:
            executors.add_metric([role], sum(role in roles for roles in alive))
        hooks = GaugeMetricFamily("diaphane_webhook_deliveries", "Deliveries of webhooks, by state.", labels=["state"])
        sent = self._service.webhooks.counts()
        for delivery in DELIVERY_STATES:
            hooks.add_metric([delivery], sent.get(delivery, 0))
        yield from (waiting, running, states, executors, hooks)


@router.get("", response_class=Response, responses={200: {"content": {"text/plain": {"schema": {"type": "string"}}}}})
def read_metrics(request: Request) -> Response:
    """Metrics in the text form of Prometheus."""
    metrics: Metrics = request.app.state.metrics
    return Response(generate_latest(metrics.registry), headers={"Content-Type": CONTENT_TYPE_LATEST})
