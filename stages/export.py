"""Stage `export`: a bundle whose three forms (torch, ONNX, GLSL) agree on real inputs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from schemas.glass import GlassReading
from schemas.pixel_weights import PixelWeights
from schemas.tail import TailName
from stages.stage import Facts, Params, Stage, training_version
from stages.tasks import Task

if TYPE_CHECKING:
    from stages.plan import Plan


class Settings(Params):
    """What a user set, for provenance; see `schemas.options.Options`.

    Attributes:
        alpha: Opacity of every surface; None: the materials' own.
        glass: How surfaces that transmit light are read.
        size: Width and height in pixels.
        budgets: As multiples of width * height.
        tail: How the fragments beyond k are averaged.
        g: Steepness of the density tail.
        seed: Of everything drawn at random.
        weights: What a pixel's errors count in training.
    """

    alpha: float | None
    glass: GlassReading
    size: tuple[int, int]
    budgets: tuple[float, ...]
    tail: TailName
    g: float
    seed: int
    weights: PixelWeights


class ExportParams(Params):
    """What is said of a bundle.

    Attributes:
        name: Of the bundle.
        scenes: Label -> digest of what was trained on.
        holdout: Label -> digest of what was not.
        licences: Label -> licence of all of them, as far as they are known.
        settings: What a user set.
        code: Code version of whatever decides what a bundle is.
    """

    name: str
    scenes: dict[str, str]
    holdout: dict[str, str]
    licences: dict[str, str]
    settings: Settings
    code: str


class ExportFacts(Facts):
    """What is known of a bundle.

    Attributes:
        digest: Over its files, before it has a card.
        files: Name -> hex sha256.
        parity: Largest difference between its forms.
    """

    digest: str
    files: dict[str, str]
    parity: float


class Export(Stage[ExportParams, ExportFacts]):
    """Writes bundles, if their forms agree."""

    name, role, title, share = "export", "train", "export and parity", 2.0
    after = ("train",)
    params, facts = ExportParams, ExportFacts

    def ask(
        self,
        plan: Plan,
        train: Task,
        scenes: Mapping[str, str],
        held_out: Mapping[str, str],
        licences: Mapping[str, str],
    ) -> Task:
        """The task of a bundle.

        Args:
            plan: Name and options.
            train: The training.
            scenes: Label -> digest of what was trained on.
            held_out: Label -> digest of what was not.
            licences: Label -> licence of all of them, as far as they are known.
        """
        options = plan.options
        settings = Settings(
            alpha=options.alpha,
            glass=options.glass,
            size=(options.width, options.height),
            budgets=plan.factors,
            tail=options.tail,
            g=options.g,
            seed=options.seed,
            weights=options.weights,
        )
        params = ExportParams(
            name=plan.name,
            scenes=dict(scenes),
            holdout=dict(held_out),
            licences=dict(licences),
            settings=settings,
            code=training_version(),
        )
        return self.task(plan.name, params, inputs=(train.address.key,), needs=(train.artifact, *train.needs))

    def known(self, task: Task) -> str:
        """See `Stage.known`."""
        return "bundles already exported"


EXPORT = Export()
