"""What was measured on a scene: its views, the pictures that are kept, and the certified optimum of a view."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import sqlalchemy as sa

from evaluation import summary
from evaluation.looks import technique_order
from evaluation.pictures import stem
from schemas.canonical import canonical_json
from schemas.glass import DEFAULT_GLASS
from schemas.measurement import Certificate, Measurement
from services.database import Database
from services.database.tables import measurements as table
from stages.evaluate import evaluated_from
from stages.store import MissingArtifact, Store
from stages.tasks import FACTS

_MOST_ROWS = 5_000
_OWN = "the materials' own opacity"
_MOST_LEVEL = 255
"""Pictures of counts have 8 bits."""


@dataclass(frozen=True, slots=True)
class Shot:
    """A measurement with where its pictures are.

    Attributes:
        artifact: `evaluate/key`.
        model: `name@version`; None for techniques without a bundle.
        measured: What was measured.
    """

    artifact: str
    model: str | None
    measured: Measurement

    @property
    def stem(self) -> str:
        """Of its pictures' file names."""
        return stem(self.measured.technique, self.measured.budget_factor)

    @property
    def has_pictures(self) -> bool:
        """Whether it was run, so that its artifact holds pictures."""
        return self.measured.skipped is None


@dataclass(frozen=True, slots=True)
class SeenView:
    """A view of the scene as it was measured last.

    Attributes:
        name: Of the view.
        width: Pixels per row.
        height: Rows.
        fragments: N, transparent fragments.
        most: Most of them in a pixel; None where the exact picture was not measured.
        shots: Latest measurement of each technique and budget.
    """

    name: str
    width: int
    height: int
    fragments: int
    most: int | None
    shots: tuple[Shot, ...]

    @property
    def exact(self) -> Shot | None:
        """The picture with all fragments, whose k is the depth complexity."""
        return next((shot for shot in self.shots if shot.measured.technique == summary.EXACT), None)

    def budgets(self) -> list[float]:
        """Those that do not hold every fragment."""
        return sorted({m.budget_factor for m in summary.compared(shot.measured for shot in self.shots)})

    def within(self, budget: float) -> list[Shot]:
        """Shots with pictures at a budget, in the order of tables."""
        order = technique_order(shot.measured.technique for shot in self.shots)
        found = [s for s in self.shots if s.measured.budget_factor == budget and s.has_pictures and s != self.exact]
        return sorted(found, key=lambda shot: order.index(shot.measured.technique))

    def top(self, shots: Sequence[Shot]) -> int:
        """Where the scale of k ends for some shots."""
        return min(_MOST_LEVEL, max([shot.measured.k_max or 1 for shot in shots], default=1))


class Setting(NamedTuple):
    """What two measurements of a view's name share if they can be compared.

    Two cameras may have the same name: sampled views and those of `--views` are numbered.

    Attributes:
        camera: JSON of the view without its name; None: it was measured before cameras were recorded.
        width: Pixels per row.
        height: Rows.
        alpha: Opacity of every surface; None: the materials' own.
        glass: How surfaces that transmit light are read.
        tail: How the fragments beyond k are averaged.
        fragments: N: it differs where another version of the code reads the scene otherwise.
    """

    camera: str | None
    width: int
    height: int
    alpha: float | None
    glass: str
    tail: str
    fragments: int

    def apart(self, other: Setting) -> str:
        """Why what was measured so cannot be compared with what was measured otherwise; empty if it can."""
        if None in (self.camera, other.camera) and self.camera != other.camera:
            return "its camera, or that of what was measured last, was not recorded: evaluate both again"
        found = []
        if self.camera != other.camera:
            one, two = (json.loads(camera or "{}") for camera in (self.camera, other.camera))
            fields = ", ".join(name for name in sorted(one | two) if one.get(name) != two.get(name))
            found.append(f"from another camera of the same name ({fields})")
        if (self.width, self.height) != (other.width, other.height):
            found.append(f"at {self.width} x {self.height} pixels")
        if self.alpha != other.alpha:
            found.append(f"with {_OWN if self.alpha is None else f'opacity {self.alpha:g}'}")
        if self.glass != other.glass:
            found.append(f"with glass read as {self.glass}")
        if self.tail != other.tail:
            found.append(f"with the tail {self.tail}")
        if self.fragments != other.fragments and not found:
            found.append(
                f"of {self.fragments:,} fragments, not {other.fragments:,}, as another version reads the scene"
            )
        return f"it was measured {' and '.join(found)}" if found else ""


def setting_of(data: Mapping[str, Any]) -> Setting:
    """What was measured, apart from technique and budget.

    Args:
        data: `schemas.measurement.Measurement` as JSON.
    """
    width, height, alpha, tail, fragments = (
        data[name] for name in ("width", "height", "alpha", "tail", "total_fragments")
    )
    glass = data.get("glass", DEFAULT_GLASS)
    return Setting(camera_of(data.get("camera")), width, height, alpha, glass, tail, fragments)


def camera_of(view: Mapping[str, Any] | None) -> str | None:
    """One text for each camera: JSON of a view without its name; None if it was not recorded."""
    return None if view is None else canonical_json({name: value for name, value in view.items() if name != "name"})


def views(database: Database, digest: str) -> list[SeenView]:
    """Views of a scene that were measured, by name.

    Args:
        database: Where measurements are.
        digest: Of the scene's content.
    """
    found: dict[str, dict[tuple[str, float], Shot]] = {}
    setting: dict[str, Setting] = {}
    for row in newest(database, table.c.scene_digest == digest, _MOST_ROWS):
        view, key, own = row.data["view"], (row.data["technique"], row.data["budget_factor"]), setting_of(row.data)
        if setting.setdefault(view, own) == own and key not in found.setdefault(view, {}):
            found[view][key] = Shot(row.artifact, row.model, Measurement.model_validate(row.data))
    return [_view(name, list(found[name].values())) for name in sorted(found)]


def newest(database: Database, where: sa.ColumnElement[bool], limit: int) -> list[Any]:
    """Rows with `artifact`, `model` and `data`, the last that were measured first.

    Args:
        database: Where measurements are.
        where: Which.
        limit: How many at most of models, and how many of techniques without one: those are measured once, and would
            be lost behind many versions.
    """
    query = sa.select(table.c.id, table.c.artifact, table.c.model, table.c.data).order_by(table.c.id.desc())
    kinds = table.c.model.is_(None), table.c.model.is_not(None)
    with database.read() as connection:
        rows = [row for kind in kinds for row in connection.execute(query.where(where, kind).limit(limit))]
    return sorted(rows, key=lambda row: -row.id)


def certificates(store: Store, view: SeenView) -> list[Certificate]:
    """The certified optimum of a view at each budget; none where its labels are not kept any more."""
    for artifact in sorted({shot.artifact for shot in view.shots}):
        try:
            made_from = store.made_from(artifact)
        except MissingArtifact:
            continue
        facts = facts_of(store, evaluated_from(made_from.inputs)[1])
        if facts is not None:
            shown = zip(made_from.params["factors"], facts["certificates"], strict=True)
            return [Certificate(scene="", view=view.name, budget_factor=f, **found) for f, found in shown]
    return []


def facts_of(store: Store, artifact: str) -> dict[str, Any] | None:
    """Facts of an artifact; None if it is gone."""
    try:
        found: dict[str, Any] = json.loads(store.read(artifact, FACTS))
    except (MissingArtifact, FileNotFoundError):
        return None
    return found


def _view(name: str, shots: list[Shot]) -> SeenView:
    first = shots[0].measured
    exact = next((shot.measured for shot in shots if shot.measured.technique == summary.EXACT), None)
    most = None if exact is None else exact.k_max
    return SeenView(name, first.width, first.height, first.total_fragments, most, tuple(shots))
