"""Measurements as the pages compare them: a model over its versions, a version or a scene over techniques."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import sqlalchemy as sa

from evaluation import summary
from evaluation.report.fronts import MEMORY, TIME, error_chart, front_of, points_of
from evaluation.report.lines import history_chart as chart_of_history
from evaluation.report.vega import Spec
from schemas.glass import DEFAULT_GLASS
from schemas.measurement import Measurement
from services.database import Database
from services.database.tables import measurements as table
from services.scene_views import camera_of, setting_of

WORSE = 1.05
"""Error over that of the version before from which a scene counts as worse."""

_MOST_ROWS = 20_000


@dataclass(frozen=True, slots=True)
class VersionError:
    """The error of a version on a scene.

    Attributes:
        mse: Geometric mean over views and budgets.
        ratio: Geometric mean of mse over that of the version before, on the same views and budgets; None: there is no
            such pair.
        pairs: How many pairs of view and budget the mean is over.
    """

    mse: float
    ratio: float | None
    pairs: int

    @property
    def is_worse(self) -> bool:
        """Whether the scene got worse by more than may be chance."""
        return self.ratio is not None and self.ratio > WORSE


@dataclass(frozen=True, slots=True)
class SceneHistory:
    """A scene over versions.

    Attributes:
        scene: Its label.
        errors: Of each version; None where it was not measured.
    """

    scene: str
    errors: tuple[VersionError | None, ...]


@dataclass(frozen=True, slots=True)
class Comparison:
    """Techniques and budgets over some measurements.

    Attributes:
        rows: A row for each technique and budget.
        best: Technique with the least error within a budget, of those that a renderer can run, over the views that
            all of these have; budgets without such views are left out.
        front: Technique and budget (None: of the exact technique) of the rows that no other beats in time and error.
        time: Time against error.
        memory: Memory against error.
    """

    rows: list[summary.Row]
    best: dict[float, str]
    front: frozenset[tuple[str, float | None]]
    time: Spec | None
    memory: Spec | None


def history(database: Database, name: str, versions: Sequence[str]) -> list[SceneHistory]:
    """Errors of a bundle's own pictures by scene, over versions.

    Args:
        database: Where they are.
        name: Of the model.
        versions: In the order in which they were published.
    """
    data = table.c.data
    shown = [f"{name}@{version}" for version in versions]
    query = (
        sa.select(
            table.c.model,
            table.c.scene,
            table.c.scene_digest,
            table.c.view,
            table.c.budget_factor,
            data["budget"].as_integer().label("budget"),
            data["alpha"].as_float().label("alpha"),
            data["glass"].as_string().label("glass"),
            data["total_fragments"].as_integer().label("fragments"),
            data["camera"].as_json().label("camera"),  # two may have the same name
            data["mse"].as_float().label("mse"),
        )
        .where(table.c.model.in_(shown), table.c.technique == summary.BUNDLE, data["exact"].as_boolean().is_(False))
        .order_by(table.c.id.desc())
        .limit(_MOST_ROWS)
    )
    found: dict[tuple[str, str], dict[str, dict[Any, float]]] = defaultdict(lambda: defaultdict(dict))
    with database.read() as connection:
        for row in connection.execute(query):
            if row.mse is not None:
                errors = found[row.scene, row.scene_digest][row.model]
                camera = camera_of(row.camera)
                glass = row.glass or DEFAULT_GLASS
                picture = row.view, camera, row.fragments, row.budget_factor, row.budget, row.alpha, glass
                errors.setdefault(picture, max(row.mse, summary.MSE_FLOOR))
    titles = _titles(found)
    return [SceneHistory(titles[scene], _compared(found[scene], shown)) for scene in sorted(found)]


def history_chart(scenes: Sequence[SceneHistory], versions: Sequence[str]) -> Spec | None:
    """The errors as a chart; None with a single version."""
    series = {scene.scene: [None if error is None else error.mse for error in scene.errors] for scene in scenes}
    worse = {(scene.scene, i) for scene in scenes for i, e in enumerate(scene.errors) if e is not None and e.is_worse}
    return chart_of_history(series, versions, worse, "Error of each scene by version")


def of_version(database: Database, reference: str) -> list[Measurement]:
    """The pictures of a version, and of the techniques without a bundle on the same views.

    Args:
        database: Where they are.
        reference: `name@version`.
    """
    with database.read() as connection:
        own = connection.execute(_latest(table.c.model == reference)).all()
        digests = {row.scene_digest for row in own}
        others = table.c.model.is_(None) & table.c.scene_digest.in_(digests)
        baseline = connection.execute(_latest(others)).all() if digests else []
    views = {_view_key(row) for row in own}
    return _unique([*own, *(row for row in baseline if _view_key(row) in views)])


def compare(measurements: Sequence[Measurement], label: str) -> Comparison:
    """Rows and charts of some measurements.

    Args:
        measurements: Of any scenes, views, techniques and budgets, each once.
        label: What they are of, for the charts.
    """
    rows = summary.rows(measurements)
    points = points_of(rows, TIME)
    return Comparison(
        rows=rows,
        best=_best(measurements),
        front=frozenset((point.technique, point.budget_factor) for point in front_of(points)),
        time=error_chart(points, label),
        memory=error_chart(points_of(rows, MEMORY), label, MEMORY),
    )


def _best(measurements: Sequence[Measurement]) -> dict[float, str]:
    errors: dict[float, dict[str, dict[tuple[str, str], float]]] = {}
    for m in summary.compared(measurements):
        if m.technique not in (summary.ORACLE, summary.EXACT):
            mine = errors.setdefault(m.budget_factor, {}).setdefault(m.technique, {})
            mine[m.scene, m.view] = max(m.mse or 0.0, summary.MSE_FLOOR)
    best = {}
    for budget, techniques in errors.items():
        shared = set.intersection(*map(set, techniques.values()))
        means = {name: summary.geometric_mean([found[view] for view in shared]) for name, found in techniques.items()}
        if shared:
            best[budget] = min(means, key=lambda name: means[name] or 0.0)
    return best


def _latest(condition: sa.ColumnElement[bool]) -> sa.Select[Any]:
    columns = table.c.id, table.c.artifact, table.c.scene_digest, table.c.view, table.c.model, table.c.data
    return sa.select(*columns).where(condition).order_by(table.c.id.desc()).limit(_MOST_ROWS)


def _view_key(row: Any) -> tuple[Any, ...]:
    return (row.scene_digest, row.view, *setting_of(row.data))


def _unique(rows: Iterable[Any]) -> list[Measurement]:
    """The first of each technique and budget on a view."""
    found: dict[Any, Measurement] = {}
    for row in rows:
        key = (*_view_key(row), row.data["technique"], row.data["budget_factor"])
        if key not in found:
            found[key] = Measurement.model_validate(row.data)
    return list(found.values())


def _titles(scenes: Iterable[tuple[str, str]]) -> dict[tuple[str, str], str]:
    """Labels; where two scenes have the same, with the beginning of their digest."""
    labels = [label for label, _ in scenes]
    return {(label, digest): label if labels.count(label) == 1 else f"{label} {digest[:8]}" for label, digest in scenes}


def _compared(errors: dict[str, dict[Any, float]], references: Sequence[str]) -> tuple[VersionError | None, ...]:
    made: list[VersionError | None] = []
    before: dict[Any, float] = {}
    for reference in references:
        own = errors.get(reference)
        if not own:
            made.append(None)
            continue
        shared = [own[key] / before[key] for key in own.keys() & before.keys()]
        mse = summary.geometric_mean(list(own.values())) or 0.0
        made.append(VersionError(mse, summary.geometric_mean(shared), len(own)))
        before = own
    return tuple(made)
