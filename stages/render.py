"""Stage `render`: the fragment dump of a view."""

from __future__ import annotations

from typing import TYPE_CHECKING

from schemas.view import View
from stages.pictured import Pictured
from stages.stage import Facts, Stage
from stages.tasks import Task

if TYPE_CHECKING:
    from stages.plan import Plan
    from stages.records import SceneEntry


class RenderFacts(Facts):
    """What was captured.

    Attributes:
        total: N, all fragments.
        occupied: Pixels that have any.
        passes: Milliseconds of each pass.
    """

    total: int
    occupied: int
    passes: dict[str, float]


class Render(Stage[Pictured, RenderFacts]):
    """Captures the fragments of views."""

    name, role, title, share = "render", "render", "capture fragments", 6.0
    after = ("scene",)
    params, facts = Pictured, RenderFacts

    def ask(self, plan: Plan, scene: SceneEntry, view: View) -> Task:
        """The task of a view."""
        options = plan.options
        size = options.width, options.height
        params = Pictured(view=view, size=size, alpha=options.alpha, glass=options.glass)
        return self.task(f"{scene.label} {view.name}", params, inputs=(scene.digest,), scene=scene.source)

    def known(self, task: Task) -> str:
        """See `Stage.known`."""
        return "views already captured"


RENDER = Render()
