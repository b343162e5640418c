"""The budgets of a run: those that were given, else what the captured views call for; and what they cannot tell."""

from __future__ import annotations

from collections.abc import Sequence

from evaluation.budget_words import holds_all, remedy, said_complete, said_defaults
from evaluation.progress import Progress
from labeller.budgets import default_budgets
from schemas.problem import ExitCode, Problem
from stages.plan import Plan
from stages.records import RenderedView


def decided(plan: Plan, views: Sequence[RenderedView], progress: Progress) -> Plan:
    """The plan with its budgets, once the views are captured and before anything is labelled.

    What is measured decides, which is the held-out views where there are any: another scene to train on leaves the
    budgets as they are, and so the labels of all other views.

    Args:
        plan: What was asked for; budgets that were given stay.
        views: The captured views, in any order.
        progress: Told the budgets that were not given, with the reason, and of views that no budget decides anything
            for.

    Raises:
        Problem: A bundle is to be built, and every budget holds all fragments of every view.
    """
    judged = [view for view in views if view.scene.held_out] or list(views)
    loads = [view.total / plan.options.pixels for view in judged]
    if not plan.factors:
        plan = plan.with_options(budgets=default_budgets(loads))
        progress.note(said_defaults(plan.factors, loads))
    everything = [view.total / plan.options.pixels for view in views]
    if plan.is_scored and holds_all(plan.factors, everything):
        raise Problem(said_complete(plan.factors, everything), remedy(everything), ExitCode.CHECK_FAILED)
    if holds_all(plan.factors, loads):
        told = "Nothing will be scored. " if plan.is_scored else ""
        progress.note(f"{said_complete(plan.factors, loads)} {told}{remedy(loads)}")
    return plan
