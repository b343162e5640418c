"""Stage `scene`: reads a stage once, and notes its views and what was found in it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from schemas.view import ListedView, View
from stages.loading import Loading
from stages.stage import Facts, Stage
from stages.tasks import Task

if TYPE_CHECKING:
    from stages.plan import Plan, PlannedScene


class SceneParams(Loading):
    """How a scene is read.

    Attributes:
        views: Cameras in stage units; empty: the stage's own, else sampled ones.
        count: How many views are sampled of a scene without cameras.
        seed: Of the sampled views.
    """

    views: tuple[ListedView, ...]
    count: int
    seed: int


class SceneFacts(Facts):
    """What was found in a scene.

    Attributes:
        views: Its views.
        triangles: Number of triangles.
        opaque: Whether nothing in it is transparent.
        content: Hash of the root file alone.
        warnings: What of the file was not supported or was missing.
        licence: Its licence and whom to name for it, as it states them; empty: it does not.
    """

    views: tuple[View, ...]
    triangles: int
    opaque: bool
    content: str
    warnings: tuple[str, ...]
    licence: str


class Scene(Stage[SceneParams, SceneFacts]):
    """Reads scenes."""

    name, role, title, share = "scene", "render", "read scenes", 1.0
    after = ()
    params, facts = SceneParams, SceneFacts

    def ask(self, plan: Plan, scene: PlannedScene) -> Task:
        """The task of a scene."""
        options = plan.options
        params = SceneParams(
            alpha=options.alpha,
            glass=options.glass,
            views=scene.listed,
            count=options.views_per_scene,
            seed=options.seed,
        )
        return self.task(scene.label, params, inputs=(scene.source.digest,), scene=scene.source)

    def known(self, task: Task) -> str:
        """See `Stage.known`."""
        return "scenes already read"


SCENE = Scene()
