"""The parts of the service, opened together."""

from __future__ import annotations

from dataclasses import dataclass

from services.database import Database, open_database
from services.engine.jobs import Jobs
from services.keys import Keys
from services.measured import Measured
from services.registry import Registry, open_registry
from services.scenes import Scenes
from services.settings import Settings
from services.storage import Storage, open_storage
from services.uploads import Uploads
from services.webhooks.addresses import networks_of
from services.webhooks.hooks import Webhooks


@dataclass(frozen=True)
class Service:
    """What the API answers from.

    Attributes:
        settings: The configuration.
        database: All records.
        storage: Artifacts and blobs.
        registry: Published versions.
        jobs: Jobs, their tasks and events, queues and executors.
        scenes: Uploaded scenes.
        keys: API keys.
        measured: Measurements and data sets.
        uploads: Uploads under way.
        webhooks: Who is told of what happens.
    """

    settings: Settings
    database: Database
    storage: Storage
    registry: Registry
    jobs: Jobs
    scenes: Scenes
    keys: Keys
    measured: Measured
    uploads: Uploads
    webhooks: Webhooks


def open_service(settings: Settings) -> Service:
    """Opens database, store and registry of a configuration.

    Raises:
        Problem: One of them cannot be opened.
    """
    database = open_database(settings.database_url)
    database.waits_for_room = False
    storage = open_storage(settings)
    jobs = Jobs(settings, database)
    return Service(
        settings=settings,
        database=database,
        storage=storage,
        registry=open_registry(database, storage.blobs, settings),
        jobs=jobs,
        scenes=Scenes(database, storage.blobs, jobs),
        keys=Keys(database),
        measured=Measured(database),
        uploads=Uploads(database, storage.blobs),
        webhooks=Webhooks(database, networks_of(settings.webhook_networks)),
    )
