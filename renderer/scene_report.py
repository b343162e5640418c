"""What a report of a scene file says; `renderer.inspection` writes it."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field, replace
from typing import Any, Literal

from schemas.problem import Problem

Kind = Literal["opaque", "cut-out", "transparent", "unused"]


@dataclass(slots=True)
class PrimCount:
    """Prims of one type.

    Attributes:
        total: All of them, those in prototypes once.
        drawn: Those that make triangles; None of a type that is no geometry.
        reasons: Why the others do not: reason -> how many.
    """

    total: int = 0
    drawn: int | None = None
    reasons: dict[str, int] = field(default_factory=dict)


@dataclass(slots=True)
class MaterialFact:
    """A material, or the prims without one.

    Attributes:
        kind: What its triangles are.
        why: What makes them so; empty if they are opaque.
        textured: Whether an image gives its colour, opacity or emission.
        prims: Prims that are drawn with it, instances apart.
        triangles: Of all copies.
    """

    kind: Kind = "unused"
    why: str = ""
    textured: bool = False
    prims: int = 0
    triangles: int = 0


@dataclass(frozen=True, slots=True)
class CameraFact:
    """A camera.

    Attributes:
        path: Its prim.
        projection: `perspective` or `orthographic`.
        fov: Vertical field of view, degrees; None: orthographic.
        height: Height of an orthographic window, metres.
        aspect: Width / height.
    """

    path: str
    projection: str
    fov: float | None
    height: float | None
    aspect: float


@dataclass(frozen=True, slots=True)
class VariantFact:
    """A variant set; prims that have the same one are counted together.

    Attributes:
        name: Of the set.
        choices: All its variants.
        selected: The one that is selected; empty if none is.
        prims: How many prims have it so.
        path: The first of them.
    """

    name: str
    choices: tuple[str, ...]
    selected: str
    prims: int
    path: str


@dataclass(slots=True)
class SceneReport:
    """Everything about a scene.

    Attributes:
        file: The root layer.
        up_axis: `X`, `Y` or `Z`.
        metres_per_unit: Scale of the stage.
        time_codes: First, last and how many a second; None if the stage has no range.
        animated: Whether geometry may differ from frame to frame.
        prims: By type.
        purposes: Geometry prims by computed purpose.
        meshes: Distinct shapes that make triangles.
        instances: Copies of them, all together.
        triangles: Of all copies, by kind: opaque, cut-out, transparent.
        materials: By path; `unbound` for what has none.
        textures: Names of the images that are sampled.
        cameras: In the order of the stage.
        variants: Variant sets of the stage as it is composed.
        bounds: Corners of what is drawn, metres, stage axes; None if nothing is.
        missing: Files that are referred to and do not exist.
        warnings: What is not supported or was missing, with the first prim and how many more.
        problem: Why the scene cannot be rendered; None if it can.
    """

    file: str
    up_axis: str
    metres_per_unit: float
    time_codes: tuple[float, float, float] | None
    animated: bool
    prims: dict[str, PrimCount]
    purposes: dict[str, int]
    variants: tuple[VariantFact, ...]
    missing: tuple[str, ...]
    meshes: int = 0
    instances: int = 0
    triangles: dict[str, int] = field(default_factory=dict)
    materials: dict[str, MaterialFact] = field(default_factory=dict)
    textures: tuple[str, ...] = ()
    cameras: tuple[CameraFact, ...] = ()
    bounds: tuple[tuple[float, ...], ...] | None = None
    warnings: tuple[str, ...] = ()
    problem: Problem | None = None

    def json(self) -> dict[str, Any]:
        """Of plain values only."""
        problem = None if self.problem is None else self.problem.title
        return {**asdict(replace(self, problem=None)), "problem": problem}
