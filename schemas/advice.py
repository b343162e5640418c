"""What a scene should be rendered with, as plain numbers: measured, and what follows from them."""

from __future__ import annotations

from typing import Final, Literal

from pydantic import BaseModel, ConfigDict, Field

Verdict = Literal["nothing", "exact", "technique", "none"]
"""Nothing is transparent; the S-buffer fits; the technique of least error that fits; nothing fits."""


SLOT_BYTES: Final = 8
"""Bytes of a fragment in the S-buffer."""
OFFSET_BYTES: Final = 4
"""Bytes a pixel of the S-buffer beside its fragments."""


def sbuffer_bytes(load: float) -> float:
    """Bytes a pixel of the S-buffer, which `renderer.exact_bytes` has of a frame.

    Args:
        load: Fragments a pixel.
    """
    return SLOT_BYTES * load + OFFSET_BYTES


def sbuffer_load(memory: int, pixels: int) -> float:
    """Fragments a pixel that an S-buffer of this memory holds; negative where its offsets alone take more.

    Args:
        memory: Bytes of all buffers.
        pixels: Of the picture.
    """
    return (memory / pixels - OFFSET_BYTES) / SLOT_BYTES


class _Plain(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class Size(_Plain):
    """A picture's size in pixels."""

    width: int = Field(gt=0)
    height: int = Field(gt=0)

    @property
    def pixels(self) -> int:
        """P."""
        return self.width * self.height

    def __str__(self) -> str:
        """As options have it."""
        return f"{self.width}x{self.height}"


class SeenView(_Plain):
    """A view that was measured.

    Attributes:
        name: Of the view.
        load: N / P, transparent fragments per pixel.
        most: Fragments of the fullest pixel; None: not known.
    """

    name: str
    load: float = Field(ge=0.0)
    most: int | None = Field(default=None, ge=0)


class Sample(_Plain):
    """A technique on a view.

    Attributes:
        view: Name of the view.
        technique: Its name.
        family: `exact`, `bounded` or `approximate`.
        budget: F / P; None: it reads none.
        tail: Of a bounded technique; '' of others.
        bundle: Label of the bundle that it runs; '' of others.
        pixel_bytes: All buffers of the frame at their peak, bytes per pixel of the picture.
        mse: Against the exact picture, 8-bit sRGB, values in [0, 1]; 0 of an exact technique.
    """

    view: str
    technique: str
    family: str
    budget: float | None = None
    tail: str = ""
    bundle: str = ""
    pixel_bytes: float = Field(ge=0.0)
    mse: float = Field(ge=0.0)


class Candidate(_Plain):
    """A technique at a budget over all views.

    Attributes:
        technique: See `Sample`.
        family: See `Sample`.
        budget: See `Sample`.
        tail: See `Sample`.
        bundle: See `Sample`.
        pixel_bytes: Largest of the views.
        mse: Geometric mean over the views; 0 of an exact technique.
        worst: Largest mse of a view.
        worst_view: Its name.
    """

    technique: str
    family: str
    budget: float | None
    tail: str
    bundle: str
    pixel_bytes: float
    mse: float
    worst: float
    worst_view: str

    @property
    def is_exact(self) -> bool:
        """Whether every fragment is blended in order whatever the view."""
        return self.family == "exact"

    def bytes_at(self, pixels: int) -> int:
        """Bytes of a picture of so many pixels: all buffers grow with them."""
        return round(self.pixel_bytes * pixels)


class Work(_Plain):
    """What a frame does, counted on one view (`schemas.work`); amounts are those of a pixel.

    Attributes:
        technique: What was counted.
        geometry_passes: How often the transparent layers are drawn.
        shaded: Fragments that are shaded.
        moved_bytes: Read and written on the device.
        atomics: Atomic operations.
    """

    technique: str
    geometry_passes: int
    shaded: float
    moved_bytes: float
    atomics: float


class AdvisedScene(_Plain):
    """What is known of a scene.

    Attributes:
        name: How it is called.
        views: Views that were measured.
        counted: Size at which fragments were counted, so that exact techniques' bytes are known.
        measured: Size of the pictures whose errors were measured.
        candidates: Techniques and budgets.
        left_out: Techniques that could not be measured, with the reason.
    """

    name: str
    views: tuple[SeenView, ...]
    counted: Size
    measured: Size
    candidates: tuple[Candidate, ...]
    left_out: tuple[str, ...] = ()

    @property
    def load(self) -> float:
        """Fragments a pixel of the fullest view."""
        return max((view.load for view in self.views), default=0.0)


class Choice(_Plain):
    """What to use within a memory at a size.

    Attributes:
        verdict: Which rule decided.
        size: Of the picture.
        memory: Bytes that it may take.
        chosen: What to use; None: there is none.
        ties: Others whose errors are as good as equal, by bytes.
        pays_above: Fragments a pixel above which the S-buffer does not fit, so that a budget pays.
    """

    verdict: Verdict
    size: Size
    memory: int
    chosen: Candidate | None = None
    ties: tuple[Candidate, ...] = ()
    pays_above: float


class Advice(_Plain):
    """What a scene should be rendered with.

    Attributes:
        scene: What is known of it.
        choice: What to use.
        best: Of each technique its best candidate that fits, else its smallest one; by error.
        front: Candidates that no other beats in both bytes and error, by bytes: the choice as memory grows.
        resolutions: The choice within the same memory at other sizes.
        work: Accounts of what was chosen and of the S-buffer; empty: not counted.
        text: The advice in sentences.
        commands: What to run next.
        warnings: What the scene has and its picture has not.
    """

    scene: AdvisedScene
    choice: Choice
    best: tuple[Candidate, ...]
    front: tuple[Candidate, ...]
    resolutions: tuple[Choice, ...]
    work: tuple[Work, ...] = ()
    text: tuple[str, ...] = ()
    commands: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
