"""What a service holds before it is measured, written through the service's own classes."""

from __future__ import annotations

import random
import time
from dataclasses import dataclass
from pathlib import Path

from schemas.job import JobSpec, SceneUse
from schemas.measurement import Measurement
from services.service import Service, open_service
from services.settings import Settings
from tests.support.bundles import make_bundle

TECHNIQUES = ("kbuffer", "kbuffer-dynamic", "kbuffer-importance", "kbuffer-deep", "kbuffer-optimal")
BUDGETS = (0.5, 1.0, 2.0, 4.0)
SCENES = tuple(f"scene-{number:02d}" for number in range(25))
NAMES = ("glass", "foliage", "smoke", "cars")
SMALL, LARGE, HUGE = 64 << 10, 8 << 20, 256 << 20
"""Bytes of the blobs."""
WHO = "key_000000000000"

_PER_ARTIFACT = 100


@dataclass(frozen=True)
class Seed:
    """What was written.

    Attributes:
        key: Secret of an admin key.
        small: sha256 of blobs of 64 KiB.
        large: Of blobs of 8 MiB.
        huge: Of the one of 256 MiB; empty if none was asked for.
        scene: Id of an accepted scene.
        models: `name@version` of all versions.
        measurements: How many.
        seconds: How long it took.
    """

    key: str
    small: tuple[str, ...]
    large: tuple[str, ...]
    huge: str
    scene: str
    models: tuple[str, ...]
    measurements: int
    seconds: float

    def spec(self, priority: str = "normal") -> dict[str, object]:
        """A job on the scene, as it is sent."""
        spec = JobSpec(kind="render", scenes=(SceneUse(scene=self.scene),), views_per_scene=1, width=64, height=48)
        return {**spec.model_dump(mode="json"), "priority": priority}


def seed(
    settings: Settings,
    folder: Path,
    *,
    measurements: int = 10_000,
    versions: int = 200,
    blobs: int = 200,
    large: int = 4,
    huge: bool = False,
) -> Seed:
    """Fills an empty service.

    Args:
        settings: Of the service.
        folder: For the bundles that are published.
        measurements: How many, over 25 scenes, 5 techniques and 4 budgets.
        versions: How many, over 4 names.
        blobs: How many of 64 KiB.
        large: How many of 8 MiB.
        huge: Whether there is one of 256 MiB.
    """
    begun = time.perf_counter()
    service = open_service(settings)
    try:
        published = _publish(service, folder, versions)
        _measure(service, measurements, published)
        draw = random.Random(7)
        _, key = service.keys.create("load", ["admin"])
        return Seed(
            key=key,
            small=tuple(service.storage.blobs.put_bytes(draw.randbytes(SMALL)).sha256 for _ in range(blobs)),
            large=tuple(service.storage.blobs.put_bytes(draw.randbytes(LARGE)).sha256 for _ in range(large)),
            huge=service.storage.blobs.put_bytes(draw.randbytes(LARGE) * (HUGE // LARGE)).sha256 if huge else "",
            scene=_scene(service),
            models=published,
            measurements=measurements,
            seconds=round(time.perf_counter() - begun, 2),
        )
    finally:
        service.jobs.close()
        service.database.close()


def _publish(service: Service, folder: Path, count: int) -> tuple[str, ...]:
    found = []
    for number in range(count):
        name = NAMES[number % len(NAMES)]
        bundle = make_bundle(folder / "bundles" / str(number), weights=f"weights {number}")
        publication = service.registry.publish(name, bundle, 1.0 / (2.0 + number), {"views": 2})
        service.registry.promote(name, publication.version, "it is newer")
        found.append(f"{name}@{publication.version}")
    return tuple(found)


def _measure(service: Service, count: int, models: tuple[str, ...]) -> None:
    digests = {label: f"{number:064x}" for number, label in enumerate(SCENES)}
    for first in range(0, count, _PER_ARTIFACT):
        found = [_measurement(number) for number in range(first, min(first + _PER_ARTIFACT, count))]
        model = models[(first // _PER_ARTIFACT) % len(models)] if models else None
        service.measured.record(f"evaluate/{first:064x}", found, digests, model, None)


def _measurement(number: int) -> Measurement:
    width, height, factor = 1430, 960, BUDGETS[number // 5 % len(BUDGETS)]
    error = 1e-4 / factor * (1.0 + number % 7)
    return Measurement(
        scene=SCENES[number // 20 % len(SCENES)],
        view=f"view-{number // 500:02d}",
        technique=TECHNIQUES[number % len(TECHNIQUES)],
        budget=round(factor * width * height),
        budget_factor=factor,
        width=width,
        height=height,
        alpha=0.3,
        tail="density",
        mse=error,
        mse_occupied=2.0 * error,
        psnr=40.0,
        flip=0.01,
        k_max=40,
        captured_fragments=1_000_000,
        total_fragments=5_000_000,
        pool_bytes=32_000_000,
        total_bytes=64_000_000,
        passes={"fill": 3.0, "resolve": 5.0},
        total_ms=8.0,
        cpu_difference=1,
    )


def _scene(service: Service) -> str:
    """A scene that counts as accepted: it is named by jobs that nobody runs."""
    sha256 = service.storage.blobs.put_bytes(b"#usda 1.0\n").sha256
    record, _ = service.scenes.create("empty", "scene.usda", {"scene.usda": sha256}, WHO)
    service.scenes.resolve_check(record.id, {"triangles": 1})
    return record.id
