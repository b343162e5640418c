"""`/compare`: two techniques or versions of models on one view; all of its state is in the address."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any, Literal, get_args

from anyio import CapacityLimiter, to_thread
from fastapi import APIRouter, Query, Request, Response
from pydantic import BaseModel, ConfigDict, Field
from starlette.background import BackgroundTask

from evaluation.summary import BUNDLE
from schemas.glass import DEFAULT_GLASS
from schemas.limits import LIMITS
from services.api.etags import is_current
from services.api.parts import PRINTED, Services
from services.dashboard.page import PageRoute, render
from services.dashboard.picturing import Picturing
from services.dashboard.pixels import MOST_ROWS, Inspector, Looked
from services.dashboard.sides import (
    Place,
    SeenScene,
    Side,
    measured_scenes,
    place,
    seen_scene,
    views,
    where_measured,
)
from services.kept import Kept
from services.problems import Refusal
from services.service import Service
from stages.store import MissingArtifact

router = APIRouter(prefix="/compare", route_class=PageRoute, include_in_schema=False)

KEPT_BYTES = 128 << 20
"""Parts of dumps and allocations, maps of k and FLIP maps that a process keeps in memory."""
AT_ONCE = 2
"""Pictures that are made at once."""
WAITING = 16
"""Pictures that are made or wait to be; more are refused."""
_MOST_APART = 20
"""Measurements of which it is said why they are not offered."""

Mode = Literal["slider", "blink", "difference", "flip", "k-a", "k-b"]
MODES: dict[Mode, str] = {
    "slider": "Slider",
    "blink": "Blink",
    "difference": "Difference",
    "flip": "FLIP",
    "k-a": "k of A",
    "k-b": "k of B",
}
Zoom = Literal["fit", "1", "2", "4", "8", "16"]
Amplify = Literal["1", "2", "4", "8", "16", "32", "64"]

_SideKey = Annotated[str, Field(pattern=r"^[A-Za-z0-9@.:+-]{0,140}$")]
_Number = Annotated[str, Field(pattern=r"^[0-9]{0,5}$")]


class Where(BaseModel):
    """What is compared; empty: whatever there is.

    Attributes:
        scene: Its id, or its digest (`services.dashboard.sides.SeenScene`).
        view: Name.
        a: Key of the first side.
        b: Key of the second side.
    """

    model_config = ConfigDict(frozen=True)

    scene: Annotated[str, Field(pattern=r"^(?:scn_[0-9a-f]{32}|[0-9a-f]{64})?$")] = ""
    view: Annotated[str, Field(max_length=LIMITS.view_name, pattern=PRINTED)] = ""
    a: _SideKey = ""
    b: _SideKey = ""


class Look(Where):
    """How it is compared.

    Attributes:
        model: `name@version` whose latest measurement is compared, where no scene is named.
        near: Whether something else is shown instead of a view or a side that is not there.
        mode: What is shown.
        zoom: Of the picture.
        amplify: What differences are multiplied with.
        split: Percent of the frame's width to the left of which the slider shows A.
        x: Column of the pixel that is inspected; empty: none.
        y: Its row.
    """

    model: Annotated[str, Field(pattern=r"^(?:[a-z0-9-]{1,63}@[A-Za-z0-9.-]{1,40})?$")] = ""
    near: Literal["", "1"] = ""
    mode: Mode = "slider"
    zoom: Zoom = "fit"
    amplify: Amplify = "8"
    split: float = Field(default=50.0, ge=0.0, le=100.0)
    x: _Number = ""
    y: _Number = ""


class PixelAsked(Where):
    """A pixel of a comparison."""

    x: int = Field(ge=0, le=99_999)
    y: int = Field(ge=0, le=99_999)


class PictureAsked(Where):
    """A picture of a comparison.

    Attributes:
        show: The picture of A, its k, or how A and B differ.
        amplify: What differences are multiplied with.
        top: Where the scale of k ends.
    """

    show: Literal["picture", "k", "difference", "flip"] = "picture"
    amplify: Amplify = "8"
    top: int = Field(default=255, ge=1, le=65_535)


@dataclass(frozen=True, slots=True)
class Compared:
    """Two sides on a view of a scene."""

    scene: SeenScene
    place: Place
    a: Side
    b: Side

    @property
    def command(self) -> str:
        """What makes the pictures, fragments and labels of both sides again: their evaluation, with its settings."""
        scene = self.scene.id if self.scene.is_uploaded else f"{self.scene.name}.usd"
        sides = (self.b, self.a, *self.place.sides)
        model = next((side.shot.model for side in sides if side.shot.model), "NAME@VERSION")
        budgets = sorted({side.shot.measured.budget_factor for side in self.place.sides if not side.is_exact})
        measured, parts = self.a.shot.measured, ["diaphane jobs submit evaluate"]
        parts += [f"--scene {scene} --model {model} --size {measured.width}x{measured.height}"]
        parts += [f"--budgets {','.join(f'{budget:g}' for budget in budgets)}"] if budgets else []
        parts += [f"--alpha {measured.alpha:g}"] if measured.alpha is not None else []
        parts += [f"--glass {measured.glass}"] if measured.glass != DEFAULT_GLASS else []
        return " ".join((*parts, f"--tail {measured.tail}"))


class Comparer:
    """What the routes share: pictures, pixels, and a bound on how many pictures are made at once.

    Args:
        service: What is compared.
    """

    def __init__(self, service: Service) -> None:
        kept, store = Kept(KEPT_BYTES), service.storage.store
        self.inspector, self.picturing = Inspector(store, kept), Picturing(store, kept)
        self._threads, self._asked = CapacityLimiter(AT_ONCE), 0

    async def run(self, make: Callable[[], bytes]) -> bytes:
        """Makes a picture in a thread.

        Raises:
            Refusal: Too many wait already.
        """
        if self._asked >= WAITING:
            raise Refusal("unavailable", f"{WAITING} pictures are being made already.", headers={"Retry-After": "2"})
        self._asked += 1
        try:
            return await to_thread.run_sync(make, limiter=self._threads)
        finally:
            self._asked -= 1


@router.get("", response_class=Response)
def show_comparison(request: Request, service: Services, look: Annotated[Look, Query()]) -> Response:
    """The page."""
    scenes = measured_scenes(service.database)
    where = _somewhere(service, look, [scene.id for scene in scenes])
    shared: dict[str, Any] = {
        "look": look,
        "scenes": scenes,
        "modes": MODES,
        "zooms": get_args(Zoom),
        "factors": get_args(Amplify),
    }
    if where is None:
        return render(request, "compare", compared=None, **shared)
    found = _compared(service, where, is_strict=not look.near)
    pixel = _pixel_of(found.place, look.x, look.y)
    page = render(
        request,
        "compare",
        compared=found,
        views=views(service.database, found.scene.digest),
        lost=_lost(service, found),
        addresses=_addresses(found, look),
        top=_top(found),
        pixel=pixel,
        looked=_look(request, found, *pixel) if pixel else None,
        most_rows=MOST_ROWS,
        most_apart=_MOST_APART,
        **shared,
    )
    page.background = BackgroundTask(_comparer(request).inspector.prepare, (found.a, found.b))
    return page


@router.get("/pixel", response_class=Response)
def show_pixel(request: Request, service: Services, asked: Annotated[PixelAsked, Query()]) -> Response:
    """The inspector's part of the page: what is known of one pixel."""
    found = _compared(service, asked)
    if asked.x >= found.place.width or asked.y >= found.place.height:
        size = f"{found.place.width} x {found.place.height}"
        raise Refusal("invalid", f"The view has {size} pixels.", "Count from 0, from the upper left corner.")
    return render(
        request,
        "pixel",
        compared=found,
        pixel=(asked.x, asked.y),
        looked=_look(request, found, asked.x, asked.y),
        most_rows=MOST_ROWS,
    )


@router.get("/picture.png", response_class=Response)
async def read_png(request: Request, service: Services, asked: Annotated[PictureAsked, Query()]) -> Response:
    """A picture as displayed, or a map in colours."""
    found = await to_thread.run_sync(_compared, service, asked)
    picturing = _comparer(request).picturing
    a, b = found.a, found.b
    make: dict[str, Callable[[], bytes]] = {
        "picture": lambda: picturing.stored(a, a.picture),
        "k": lambda: picturing.counts(a, asked.top),
        "difference": lambda: picturing.difference(a, b, int(asked.amplify)),
        "flip": lambda: picturing.flip(a, b),
    }
    return await _picture(request, found, asked, make[asked.show], "png", "image/png")


@router.get("/picture.exr", response_class=Response)
async def read_exr(request: Request, service: Services, asked: Annotated[PictureAsked, Query()]) -> Response:
    """A picture as it was rendered: linear, half floats."""
    if asked.show != "picture":
        raise Refusal("invalid", "Only pictures are kept as OpenEXR, no maps.", "Open the map as PNG.")
    found = await to_thread.run_sync(_compared, service, asked)
    side, picturing = found.a, _comparer(request).picturing
    return await _picture(request, found, asked, lambda: picturing.stored(side, side.linear), "exr", "image/x-exr")


async def _picture(
    request: Request, found: Compared, asked: PictureAsked, make: Callable[[], bytes], suffix: str, media: str
) -> Response:
    """A picture that the browser keeps, and asks whether it is still the one."""
    shown = (found.a,) if asked.show in ("picture", "k") else (found.a, found.b)
    what = [asked.show, suffix, asked.amplify, asked.top, *((side.shot.artifact, side.key) for side in shown)]
    tag = hashlib.sha256(repr(what).encode()).hexdigest()[:32]
    name = "-".join([_plain(found.scene.name), _plain(found.place.view), asked.show, *(_plain(s.key) for s in shown)])
    headers = {
        "ETag": f'"{tag}"',
        # The address names a view: what was measured on it last may be another picture tomorrow.
        "Cache-Control": "private, no-cache",
        "Content-Disposition": f'inline; filename="{name}.{suffix}"',
    }
    if is_current(request, tag):
        return Response(status_code=304, headers=headers)
    try:
        content = await _comparer(request).run(make)
    except MissingArtifact:
        raise Refusal(
            "not-found",
            "The picture was removed because of its age.",
            f"Evaluate it again: {found.command}.",
        ) from None
    except FileNotFoundError:
        raise Refusal(
            "not-found",
            "The evaluation does not keep this picture: it was made by an earlier version of Diaphane.",
            "Evaluate the model on the scene again.",
        ) from None
    return Response(content, media_type=media, headers=headers)


def _comparer(request: Request) -> Comparer:
    comparer: Comparer = request.app.state.comparer
    return comparer


def _somewhere(service: Service, look: Look, known: list[str]) -> Where | None:
    """What is asked for, completed with what was measured last; None: nothing was measured."""
    if not look.scene and look.model:
        found = where_measured(service.database, look.model)
        if found is None:
            raise Refusal(
                "not-found",
                f"Nothing was measured with {look.model}.",
                f"Submit `diaphane jobs submit evaluate --scene SCENE --model {look.model}`.",
            )
        return Where(scene=found[0], view=found[1], b=found[2])
    if not look.scene and not known:
        return None
    return Where(scene=look.scene or known[0], view=look.view, a=look.a, b=look.b)


def _compared(service: Service, where: Where, is_strict: bool = True) -> Compared:
    """The two sides of an address.

    Args:
        service: What was measured.
        where: The address; what is empty in it is chosen.
        is_strict: Whether what is not there is refused; else it is chosen, too.

    Raises:
        Problem: There is no such scene.
        Refusal: Nothing, or not that, was measured on the scene, or on the view.
    """
    scene = seen_scene(service.database, where.scene)
    if scene is None:
        service.scenes.get(where.scene)
        raise Refusal("not-found", "Nothing was measured on this scene yet.", "Submit a job `evaluate` with it.")
    known = [] if where.view and is_strict else views(service.database, scene.digest)
    view = where.view if where.view in known or not known else known[0]
    there = place(service.database, scene.digest, view)
    keys = {side.key for side in there.sides}
    b = there.side(where.b) if where.b and (is_strict or where.b in keys) else there.best()
    a = there.side(where.a) if where.a and (is_strict or where.a in keys) else there.rival(b)
    return Compared(scene, there, a, b)


def _look(request: Request, found: Compared, x: int, y: int) -> list[Looked]:
    models = [side for side in found.place.sides if side.shot.measured.technique == BUNDLE]
    inspector = _comparer(request).inspector
    return inspector.look([("A", found.a), ("B", found.b)], models, y * found.place.width + x)


def _lost(service: Service, found: Compared) -> list[tuple[str, str]]:
    """Letters and titles of the sides whose pictures are gone."""
    sides = (("A", found.a), ("B", found.b))
    return [(letter, side.title) for letter, side in sides if not service.storage.store.holds(side.shot.artifact)]


def _top(found: Compared) -> int:
    """Where the scale of k ends for both sides; that of the exact picture is the depth complexity, and left out."""
    bounded = [side for side in (found.a, found.b) if not side.is_exact] or [found.a]
    return min(65_535, max(1, *(side.shot.measured.k_max or 1 for side in bounded)))


def _addresses(found: Compared, look: Look) -> dict[str, dict[str, Any]]:
    """Queries of the pictures that the page shows, by mode; those of A and B by letter."""
    on = {"scene": found.scene.id, "view": found.place.view}
    a, b, both = {**on, "a": found.a.key}, {**on, "a": found.b.key}, {**on, "a": found.a.key, "b": found.b.key}
    top = _top(found)
    return {
        "a": {**a, "show": "picture"},
        "b": {**b, "show": "picture"},
        "difference": {**both, "show": "difference", "amplify": look.amplify},
        "flip": {**both, "show": "flip"},
        "k-a": {**a, "show": "k", "top": top},
        "k-b": {**b, "show": "k", "top": top},
    }


def _pixel_of(there: Place, x: str, y: str) -> tuple[int, int] | None:
    """The pixel of an address, within the view; None if it names none."""
    if not x or not y:
        return None
    return min(int(x), there.width - 1), min(int(y), there.height - 1)


def _plain(text: str) -> str:
    """A name as part of a file's: letters, digits, points and hyphens."""
    return "".join(c if c.isascii() and (c.isalnum() or c in ".-") else "-" for c in text)[:60].strip("-.") or "x"
