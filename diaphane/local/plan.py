"""The plan of a local build."""

from __future__ import annotations

from diaphane.local.options import BuildOptions
from stages.plan import Plan, PlannedScene
from stages.tasks import Source


def plan_of_build(asked: BuildOptions) -> Plan:
    """The plan of a local build: scenes are the user's own files, and resolve as they do for any USD program.

    Raises:
        Problem: A file cannot be read.
    """
    # USD is loaded only here: a job's scenes have their digest already.
    from renderer.scene import scene_digest
    from renderer.views import listed_views

    scenes = []
    for path in asked.scenes:
        root = path.resolve()
        source = Source(digest=scene_digest(path), root=root.name, folder=str(root.parent), trusted=True)
        listed = () if asked.views is None else listed_views(asked.views, path)
        licence = asked.licences.get(path)
        scenes.append(PlannedScene(asked.labels[path], source, path in asked.holdout, listed, licence))
    return Plan(asked.name, tuple(scenes), asked.options)
