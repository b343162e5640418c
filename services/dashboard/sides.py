"""What can be compared on a view: techniques at budgets, versions of models at budgets, and the exact picture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import PurePosixPath
from typing import Any

import sqlalchemy as sa

from evaluation import summary
from evaluation.looks import LOOKS, title
from evaluation.pictures import EXACT
from schemas.measurement import Measurement
from services.database import Database
from services.database.tables import measurements as table
from services.database.tables import scenes
from services.problems import Refusal
from services.scene_views import Shot, newest, setting_of

_MOST_ROWS = 2_000
_MOST_SCENES = 500
_EXACT = "exact"


@dataclass(frozen=True, slots=True)
class Side:
    """One of the two pictures of a comparison.

    Attributes:
        key: Names it in addresses: `exact`, `TECHNIQUE:FACTOR` or `NAME@VERSION:FACTOR`.
        shot: The measurement, and where its pictures are.
    """

    key: str
    shot: Shot

    @property
    def is_exact(self) -> bool:
        """Whether it is the picture with all fragments."""
        return self.key == _EXACT

    @property
    def name(self) -> str:
        """What a reader calls the technique or version."""
        return "exact" if self.is_exact else self.shot.model or title(self.shot.measured.technique)

    @property
    def title(self) -> str:
        """The same with its budget."""
        return self.name if self.is_exact else f"{self.name}, F = {self.shot.measured.budget_factor:g} W H"

    @property
    def picture(self) -> str:
        """File of the picture in its artifact."""
        return EXACT if self.is_exact else f"{self.shot.stem}.png"

    @property
    def linear(self) -> str:
        """File of the same as linear OpenEXR."""
        return str(PurePosixPath(self.picture).with_suffix(".exr"))

    @property
    def counts(self) -> str | None:
        """File of its map of k; None if there is none."""
        is_own = not self.is_exact or self.shot.measured.technique == summary.EXACT
        return f"{self.shot.stem}.k.png" if is_own and self.shot.has_pictures else None


@dataclass(frozen=True, slots=True)
class Place:
    """A view of a scene as it was measured last, with what can be compared there.

    Attributes:
        view: Its name.
        width: Pixels per row.
        height: Rows.
        sides: What has pictures, in the order in which they are offered.
        apart: Key -> why it cannot be compared with these, though it was measured on a view of this name.
        skipped: Key -> why it was not rendered.
    """

    view: str
    width: int
    height: int
    sides: tuple[Side, ...]
    apart: dict[str, str]
    skipped: dict[str, str]

    def side(self, key: str) -> Side:
        """The side of a key.

        Raises:
            Refusal: There is none.
        """
        found = next((side for side in self.sides if side.key == key), None)
        if found is not None:
            return found
        why = self.skipped.get(key) or self.apart.get(key) or "it was not measured"
        raise Refusal(
            "not-found",
            f"There is no picture of '{key}' on the view '{self.view}': {why}.",
            "Choose another technique or budget on the page Compare, or evaluate the model on this scene.",
        )

    def best(self) -> Side:
        """What is worth looking at first: the latest model at a budget in the middle, or else the optimum there."""
        bounded = [side for side in self.sides if not side.is_exact]
        factors = sorted({side.shot.measured.budget_factor for side in bounded})
        middle = [s for s in bounded if s.shot.measured.budget_factor == factors[len(factors) // 2]]
        return _first(middle, (summary.BUNDLE, summary.ORACLE)) or self.side(_EXACT)

    def rival(self, side: Side) -> Side:
        """What a side is compared with first: VKB, or any other technique, at its budget; else the exact picture."""
        budget = side.shot.measured.budget_factor
        others = [s for s in self.sides if not s.is_exact and s != side and s.shot.measured.budget_factor == budget]
        return _first(others, (summary.BASELINE,)) or self.side(_EXACT)


def _first(sides: Sequence[Side], techniques: Sequence[str]) -> Side | None:
    """The first of the first technique that is there, or of any."""
    ranked = sorted(sides, key=lambda side: [name != side.shot.measured.technique for name in techniques])
    return ranked[0] if ranked else None


def views(database: Database, digest: str) -> list[str]:
    """Names of the views of a scene that were measured, in order."""
    query = sa.select(table.c.view).where(table.c.scene_digest == digest).distinct().limit(_MOST_ROWS)
    with database.read() as connection:
        return sorted(connection.scalars(query))


def place(database: Database, digest: str, view: str) -> Place:
    """A view with all that can be compared there.

    Args:
        database: Where measurements are.
        digest: Of the scene's content.
        view: Name of the view.

    Raises:
        Refusal: Nothing was measured there.
    """
    mine = (table.c.scene_digest == digest) & (table.c.view == view)
    rows = newest(database, mine, _MOST_ROWS)
    if not rows:
        raise Refusal(
            "not-found",
            f"Nothing was measured on a view '{view}' of this scene.",
            "Choose one of the views on the scene's page, or evaluate a model on the scene.",
        )
    setting = setting_of(rows[0].data)
    found: dict[str, Any] = {}
    apart: dict[str, str] = {}
    for row in rows:
        if why := setting_of(row.data).apart(setting):
            apart.setdefault(_key(row.data, row.model), why)
        else:
            found.setdefault(_key(row.data, row.model), row)
    shots = {key: Shot(row.artifact, row.model, Measurement.model_validate(row.data)) for key, row in found.items()}
    with_pictures = [shot for shot in shots.values() if shot.has_pictures]
    if with_pictures and (_EXACT not in shots or not shots[_EXACT].has_pictures):
        shots[_EXACT] = with_pictures[0]  # the reference lies beside every picture that was compared with it
    sides = [Side(key, shot) for key, shot in shots.items() if shot.has_pictures]
    names = [side.name for side in sides]  # latest first
    skipped = [(key, shot.measured.skipped) for key, shot in shots.items()]
    first = next(iter(shots.values())).measured
    return Place(
        view=view,
        width=first.width,
        height=first.height,
        sides=tuple(sorted(sides, key=lambda side: _order(side, names))),
        apart={key: why for key, why in apart.items() if key not in shots},
        skipped={key: f"it was not rendered, {why}" for key, why in skipped if why is not None},
    )


@dataclass(frozen=True, slots=True)
class SeenScene:
    """A scene on which something was measured.

    Attributes:
        id: Of the uploaded scene; of one that was never uploaded, as those of local builds, its digest.
        name: How it is called.
        digest: Of its content.
    """

    id: str
    name: str
    digest: str

    @property
    def is_uploaded(self) -> bool:
        """Whether the service has its files, and a page of it."""
        return self.id != self.digest


def measured_scenes(database: Database) -> list[SeenScene]:
    """The scenes on which something was measured, the latest measured first."""
    latest = (
        sa.select(table.c.scene_digest, sa.func.max(table.c.id).label("last")).group_by(table.c.scene_digest).subquery()
    )
    query = _seen(table.c.id == latest.c.last).join(latest, latest.c.scene_digest == table.c.scene_digest)
    with database.read() as connection:
        return [_scene(row) for row in connection.execute(query.order_by(table.c.id.desc()).limit(_MOST_SCENES))]


def seen_scene(database: Database, scene_id: str) -> SeenScene | None:
    """A scene by its id; None: nothing was measured on it.

    Args:
        database: Where measurements are.
        scene_id: See `SeenScene`.
    """
    query = _seen((scenes.c.id == scene_id) | (table.c.scene_digest == scene_id)).order_by(table.c.id.desc()).limit(1)
    with database.read() as connection:
        row = connection.execute(query).first()
    return None if row is None else _scene(row)


def _seen(where: sa.ColumnElement[bool]) -> sa.Select[Any]:
    """Scene of each measurement that fulfils a condition."""
    columns = scenes.c.id, scenes.c.name, table.c.scene, table.c.scene_digest
    return (
        sa.select(*columns).select_from(table.outerjoin(scenes, scenes.c.digest == table.c.scene_digest)).where(where)
    )


def _scene(row: Any) -> SeenScene:
    return SeenScene(row.id or row.scene_digest, row.name or row.scene, row.scene_digest)


def where_measured(database: Database, reference: str) -> tuple[str, str, str] | None:
    """Where a model was measured last: id of the scene, view, and key of the side; None: nowhere.

    Args:
        database: Where measurements are.
        reference: `name@version`.
    """
    query = (
        _seen(table.c.model == reference)
        .add_columns(table.c.view, table.c.model, table.c.data)
        .order_by(table.c.id.desc())
        .limit(_MOST_SCENES)
    )
    with database.read() as connection:
        rows = connection.execute(query).all()
    ran = [row for row in rows if row.data["skipped"] is None] or rows
    return (_scene(ran[0]).id, ran[0].view, _key(ran[0].data, ran[0].model)) if ran else None


def _key(data: dict[str, Any], model: str | None) -> str:
    if data["technique"] == summary.EXACT:
        return _EXACT
    return f"{model or data['technique']}:{data['budget_factor']:g}"


def _order(side: Side, names: Sequence[str]) -> tuple[Any, ...]:
    known, technique = list(LOOKS), side.shot.measured.technique
    rank = known.index(technique) if technique in known else len(known)
    return not side.is_exact, rank, names.index(side.name), side.shot.measured.budget_factor
