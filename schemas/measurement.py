"""What was measured: one technique on one view at one budget, and everything a report shows."""

from __future__ import annotations

from typing import Any

from pydantic import BaseModel, ConfigDict, Field

from schemas.glass import DEFAULT_GLASS, GlassReading
from schemas.tail import TailName
from schemas.view import View


class _Record(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class Measurement(_Record):
    """One technique on one view at one budget, against the exact picture of that view.

    Pictures are compared as displayed: 8-bit sRGB. Fields that were not measured are None.

    Attributes:
        scene: Label of the scene.
        view: Name of the view.
        camera: The view itself, which its name alone does not tell: sampled views are numbered. None: it was measured
            before cameras were recorded.
        technique: Name of the technique, e.g. `kbuffer-deep`.
        budget: F, fragments of a frame.
        budget_factor: F / (width * height).
        width: Pixels per row.
        height: Rows.
        alpha: Opacity that every surface was given; None: the materials' own.
        glass: How surfaces that transmit light were read.
        tail: How the fragments beyond k are averaged.
        mse: Mean over RGB of the squared difference of sRGB values in [0,1], whole picture. Shown times 1e5.
        mse_occupied: The same over pixels with at least one transparent fragment.
        psnr: -10 log10(mse), dB; None where mse is 0.
        flip: Mean FLIP at 67.02 pixels per degree.
        k_min: Least core fragments of an occupied pixel.
        k_max: Most core fragments of a pixel.
        captured_fragments: Sum of k over the pixels, at most `budget`.
        total_fragments: N, transparent fragments of the view.
        pool_bytes: Size of the fragment pool.
        pixel_bytes: All other buffers of the technique that live beside it, bytes per pixel.
        total_bytes: Peak of a frame: all buffers of the technique that depend on budget or resolution.
        passes: Wall time of each pass, ms.
        total_ms: Wall time of a frame, ms.
        cpu_difference: Largest difference, of 255, between the picture and the CPU simulation of the same allocation.
        exact: Whether the budget holds every fragment, so that the picture is exact by construction.
        skips: What of the frame was not needed and is exact without it -> how often.
        skipped: Why it was not run; None if it was.
    """

    scene: str
    view: str
    camera: View | None = None
    technique: str
    budget: int = Field(gt=0)
    budget_factor: float = Field(gt=0.0)
    width: int = Field(gt=0)
    height: int = Field(gt=0)
    alpha: float | None
    glass: GlassReading = DEFAULT_GLASS
    tail: TailName
    mse: float | None = Field(default=None, ge=0.0)
    mse_occupied: float | None = Field(default=None, ge=0.0)
    psnr: float | None = None
    flip: float | None = Field(default=None, ge=0.0, le=1.0)
    k_min: int | None = Field(default=None, ge=0)
    k_max: int | None = Field(default=None, ge=0)
    captured_fragments: int | None = Field(default=None, ge=0)
    total_fragments: int = Field(ge=0)
    pool_bytes: int | None = Field(default=None, ge=0)
    pixel_bytes: int | None = Field(default=None, ge=0)
    total_bytes: int | None = Field(default=None, ge=0)
    passes: dict[str, float] = {}
    total_ms: float | None = Field(default=None, ge=0.0)
    cpu_difference: int | None = Field(default=None, ge=0, le=255)
    exact: bool = False
    skips: dict[str, int] = {}
    skipped: str | None = None


class Certificate(_Record):
    """How good the `optimal` allocation of a view provably is.

    Attributes:
        scene: Label of the scene.
        view: Name of the view.
        budget_factor: F / (width * height).
        error: Sum over pixels of the squared error of the allocation.
        bound: No allocation of this budget has a smaller sum (Lagrangian dual).
        gap: (error - bound) / error; 0 where the error is 0.
        rules: The same sum for every other rule of allocation, by name.
    """

    scene: str
    view: str
    budget_factor: float = Field(gt=0.0)
    error: float = Field(ge=0.0)
    bound: float
    gap: float
    rules: dict[str, float] = {}


class TrainingPoint(_Record):
    """A step of the training.

    Attributes:
        step: Steps done.
        loss: Of that step's batch.
        over_optimum: Squared error over the optimum's at the scored budgets, geometric mean over the training views.
    """

    step: int = Field(ge=0)
    loss: float
    over_optimum: float


class SceneSummary(_Record):
    """A scene of the build.

    Attributes:
        label: Unique short name.
        held_out: Whether it was evaluated on and not trained on.
        views: Number of views.
        triangles: Number of triangles.
        fragments: Transparent fragments over all views.
        warnings: What of the file was not supported or was missing.
    """

    label: str
    held_out: bool
    views: int = Field(ge=0)
    triangles: int = Field(ge=0)
    fragments: int = Field(ge=0)
    warnings: tuple[str, ...] = ()


class RegistryResult(_Record):
    """What became of the bundle.

    Attributes:
        reference: `name@version`.
        folder: Where its files lie.
        champion: Whether the alias `champion` means it now.
        reason: Why, or why not, in one sentence.
        score: Geometric mean of the bundle's mse over VKB's, held-out views; lower is better; None if not measured.
    """

    reference: str
    folder: str
    champion: bool
    reason: str
    score: float | None = None


class ReportData(_Record):
    """Everything a report shows, apart from the pictures.

    Attributes:
        name: Name of the bundle.
        command: The command that makes this report again.
        created: UTC, ISO 8601.
        scenes: All scenes, held-out ones marked.
        measurements: Of all techniques, views and budgets.
        certificates: Of the optimal allocations.
        training: History of the training, by step.
        registry: What became of the bundle.
        skipped: What was not done because it did not need to be, with counts.
        machine: Processor, cores, memory, GL renderer.
        versions: Of Python and the libraries.
        provenance: Digests and parameters: seed, tail, code versions, dataset.
    """

    name: str
    command: str
    created: str
    scenes: tuple[SceneSummary, ...]
    measurements: tuple[Measurement, ...]
    certificates: tuple[Certificate, ...] = ()
    training: tuple[TrainingPoint, ...] = ()
    registry: RegistryResult | None = None
    skipped: dict[str, int] = {}
    machine: dict[str, str] = {}
    versions: dict[str, str] = {}
    provenance: dict[str, Any] = {}
