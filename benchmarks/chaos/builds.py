"""Small builds, no two alike: real scenes, checked, rendered, labelled, trained on, exported, evaluated, published."""

from __future__ import annotations

import time
from typing import Any

from tests.support.cluster import Cluster

FAMILIES = 4
"""Pairs of scenes; the builds of a pair share what is rendered and labelled, and wait for each other's tasks."""
SIZE = 64, 48
STEPS = 20
_CHECK_SECONDS = 900.0
_SCENE = """#usda 1.0
(
    defaultPrim = "World"
    metersPerUnit = 1
    upAxis = "Y"
)
def Xform "World"
{{
    def Sphere "outer"
    {{
        double radius = {radius}
        color3f[] primvars:displayColor = [(0.9, 0.4, 0.2)]
    }}
    def Cube "inner"
    {{
        double size = 1
        color3f[] primvars:displayColor = [(0.1, 0.5, 0.9)]
    }}
    def Camera "front"
    {{
        double3 xformOp:translate = (0, 0.5, 6)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }}
}}
"""


def upload(cluster: Cluster, families: int) -> list[tuple[str, str]]:
    """Has the scenes checked by the cluster's workers.

    Args:
        cluster: Takes them.
        families: How many pairs.

    Returns:
        Ids of each pair: what is trained on, and what is held out.
    """
    pairs = [tuple(_scene(cluster, 1.0 + 0.02 * (2 * n + held_out)) for held_out in (0, 1)) for n in range(families)]
    found = [(first, second) for first, second in pairs]
    end = time.monotonic() + _CHECK_SECONDS
    for scene in (scene for pair in found for scene in pair):
        while (record := cluster.service.scenes.get(scene)).state == "checking" and time.monotonic() < end:
            time.sleep(0.1)
        if record.state != "accepted":
            raise RuntimeError(f"the scene {record.name} is {record.state}: {record.problem}\n{cluster.logs()}")
    return found


def spec(pairs: list[tuple[str, str]], number: int) -> dict[str, Any]:
    """A build.

    Args:
        pairs: Ids of scenes.
        number: Which build.
    """
    family = number % len(pairs)
    learnt, held_out = pairs[family]
    return {
        "kind": "build",
        "name": f"family-{family}",
        "scenes": [{"scene": learnt}, {"scene": held_out, "holdout": True}],
        "alpha": 0.5,
        "budgets": [1.0],
        "views_per_scene": 1,
        "width": SIZE[0],
        "height": SIZE[1],
        "steps": STEPS + number // len(pairs),
    }


def _scene(cluster: Cluster, radius: float) -> str:
    service, name = cluster.service, f"sphere-{radius:.2f}.usda"
    sha256 = service.storage.blobs.put_bytes(_SCENE.format(radius=f"{radius:.2f}").encode()).sha256
    return service.scenes.create(name, name, {name: sha256}, cluster.key_id)[0].id
