"""Small builds, no two alike: real scenes, checked, rendered, labelled, trained on, exported, evaluated, published."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

from schemas.job import JobKind
from tests.support.cluster import Cluster
from tests.support.solids import SPHERE_AND_CUBE

BUILDS_OF_FAMILY = 2
"""At least: builds of the same scenes share what is rendered and labelled, and wait for each other's tasks."""
MOST_FAMILIES = 10
SIZE = 64, 48
STEPS = 20
_CHECK_SECONDS = 900.0


def upload(cluster: Cluster, families: int, scenes: int = 2) -> list[list[str]]:
    """Has the scenes checked by the cluster's workers.

    Args:
        cluster: Takes them.
        families: How many sets of scenes.
        scenes: Of each set.

    Returns:
        Ids of each set: the first is trained on, a second one is held out.
    """
    found = [[_scene(cluster, 1.0 + 0.02 * (scenes * n + which)) for which in range(scenes)] for n in range(families)]
    end = time.monotonic() + _CHECK_SECONDS
    for scene in (scene for family in found for scene in family):
        while (record := cluster.service.scenes.get(scene)).state == "checking" and time.monotonic() < end:
            time.sleep(0.1)
        if record.state != "accepted":
            raise RuntimeError(f"the scene {record.name} is {record.state}: {record.problem}\n{cluster.logs()}")
    return found


def families_of(builds: int) -> int:
    """How many sets of scenes so many builds have."""
    return min(MOST_FAMILIES, max(1, builds // BUILDS_OF_FAMILY))


def spec(families: Sequence[Sequence[str]], number: int, kind: JobKind) -> dict[str, Any]:
    """A build, or the part of one that ends earlier.

    Args:
        families: Ids of scenes.
        number: Which build.
        kind: `build`, or another kind that begins with scenes.
    """
    family = number % len(families)
    return {
        "kind": kind,
        "name": f"family-{family}",
        "scenes": [{"scene": scene, "holdout": index > 0} for index, scene in enumerate(families[family])],
        "alpha": 0.5,
        "budgets": [1.0],
        "views_per_scene": 1,
        "width": SIZE[0],
        "height": SIZE[1],
        "steps": STEPS + number // len(families),
    }


def _scene(cluster: Cluster, radius: float) -> str:
    service, name = cluster.service, f"sphere-{radius:.2f}.usda"
    sha256 = service.storage.blobs.put_bytes(SPHERE_AND_CUBE.format(radius=f"{radius:.2f}").encode()).sha256
    return service.scenes.create(name, name, {name: sha256}, cluster.key_id)[0].id
