"""What `diaphane bench` measured: passes, bytes and errors of techniques on views; JSON: `docs/bench.schema.json`.

Errors compare with the exact picture, composited on the CPU from all fragments. MSE is the mean over RGB and pixels of
the squared difference of values in [0,1]; tables show it times 1e5.
"""

from __future__ import annotations

from typing import Final, Literal

from pydantic import BaseModel, ConfigDict, Field

from schemas.tail import TailName
from schemas.work import Device, PassWork

FORMAT: Final = "diaphane-bench/1"

LOSSLESS: Final = 1e-7
"""Mean squared error that is added on both sides of a score: below it a picture counts as lossless."""

Basis = Literal["fragments", "memory", "none"]
"""What a cell is given: F = budget_factor x W x H; the F that the total bytes of the fixed k-buffer of that factor
leave it (DHOIT, Eq. 1); nothing, since the technique reads no budget."""


class _Record(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class Times(_Record):
    """Repeated times, milliseconds.

    Attributes:
        median: Of the repeats.
        least: The shortest.
        most: The longest.
    """

    median: float
    least: float
    most: float


class CellKey(_Record):
    """What tells a cell from the others of its view.

    Attributes:
        technique: Name.
        basis: See `Basis`.
        budget_factor: F / (width * height), or the fixed k whose total memory is given; None without a budget.
        tail: How the fragments beyond k are averaged; None for techniques without a tail.
        g: Steepness of the density tail; None for other tails.
        bundle: Name and digest of the bundle, for `kbuffer-deep`.
    """

    technique: str
    basis: Basis
    budget_factor: float | None = Field(default=None, gt=0.0)
    tail: TailName | None = None
    g: float | None = None
    bundle: str | None = None


class BenchCell(CellKey):
    """A technique on a view within a budget. Fields that were not measured are None.

    Attributes:
        family: `exact`, `bounded` or `approximate`.
        budget: F, fragments.
        exact: Whether the budget holds every fragment; then there is no score.
        repeats: Timed frames, after a warm-up.
        passes: Milliseconds of each pass by the view's clock, readbacks in one of their own.
        gpu: Medians of each pass by GPU timer queries, milliseconds; empty where the driver's are not right.
        frame: Sum of the passes.
        mse: Paper's convention: as displayed, clamped 8-bit sRGB, whole image.
        mse_display: The same of sRGB values before they are rounded to 8 bits.
        mse_linear: Of linear RGB, neither clamped nor rounded.
        mse_occupied: As `mse`, over pixels with at least one transparent fragment.
        psnr: -10 log10(mse), dB; None where mse is 0.
        ssim: Mean structural similarity of luma.
        flip: Mean LDR-FLIP at 67.02 pixels per degree.
        k_min: Least core fragments of an occupied pixel.
        k_max: Most.
        captured_fragments: Sum of k.
        pool_bytes: Size of the fragment pool.
        pixel_bytes: All other buffers beside it, bytes per pixel.
        early_bytes: Most before there is a pool, bytes per pixel.
        total_bytes: The peak of the frame: pool and what lives beside it, or what was there before;
            of multilayer and adaptive their nodes, of an engine's lists what the engine takes; the pool emulates them.
        fits: Whether the pool is no larger than one storage buffer (`schemas.limits.LIMITS.buffer_bytes`). A larger one
            is rendered in bands of rows, or not at all (`problem`); the bytes are what the whole frame needs.
        score: (mse + LOSSLESS) / (mse of the oracle + LOSSLESS).
        score_display: The same of `mse_display`.
        over_optimum: As `score`, with the certified optimum of the cell's own tail instead of the oracle.
        flicker: Mean over frames, pixels and channels of the change of the display error from frame to frame.
        flicker_k: Mean change of k from frame to frame, over pixels occupied in both.
        skips: What was not needed and is exact without it -> how often.
        work: Pass -> what it does, counted in one frame after the opaque pass; empty where it was not.
        problem: Why there is no picture.
    """

    family: str
    budget: int | None = Field(default=None, ge=0)
    exact: bool = False
    repeats: int = Field(default=0, ge=0)
    passes: dict[str, Times] = {}
    gpu: dict[str, float] = {}
    frame: Times | None = None
    mse: float | None = Field(default=None, ge=0.0)
    mse_display: float | None = Field(default=None, ge=0.0)
    mse_linear: float | None = Field(default=None, ge=0.0)
    mse_occupied: float | None = Field(default=None, ge=0.0)
    psnr: float | None = None
    ssim: float | None = Field(default=None, le=1.0)
    flip: float | None = Field(default=None, ge=0.0, le=1.0)
    k_min: int | None = Field(default=None, ge=0)
    k_max: int | None = Field(default=None, ge=0)
    captured_fragments: int | None = Field(default=None, ge=0)
    pool_bytes: int | None = Field(default=None, ge=0)
    pixel_bytes: int | None = Field(default=None, ge=0)
    early_bytes: int = Field(default=0, ge=0)
    total_bytes: int | None = Field(default=None, ge=0)
    fits: bool = True
    score: float | None = Field(default=None, gt=0.0)
    score_display: float | None = Field(default=None, gt=0.0)
    over_optimum: float | None = Field(default=None, gt=0.0)
    flicker: float | None = Field(default=None, ge=0.0)
    flicker_k: float | None = Field(default=None, ge=0.0)
    skips: dict[str, int] = {}
    work: dict[str, PassWork] = {}
    problem: str | None = None

    @property
    def key(self) -> CellKey:
        """What tells it from the others."""
        return CellKey(**{name: getattr(self, name) for name in CellKey.model_fields})


class Yardstick(_Record):
    """An offline allocation, composited on the CPU: what scores divide by.

    Attributes:
        rule: `greedy`: DHOIT's Algorithm 1, the oracle; `optimal`: the certified optimum.
        tail: Tail of the curves and of the picture.
        g: Steepness of the density tail; None for other tails.
        budget_factor: F / (width * height).
        budget: F.
        mse: As of a cell.
        mse_display: As of a cell.
        gap: Largest fraction by which an allocation could be better; None for the oracle.
        k_min: Least k of an occupied pixel.
        k_max: Most.
        captured_fragments: Sum of k.
    """

    rule: Literal["greedy", "optimal"]
    tail: TailName
    g: float | None
    budget_factor: float
    budget: int
    mse: float
    mse_display: float
    gap: float | None
    k_min: int
    k_max: int
    captured_fragments: int


class BenchView(_Record):
    """A view of a scene, and what was measured of it by one run on one machine.

    Attributes:
        key: Digest of everything but the cells: results of equal keys belong together.
        scene: Name of its file, without the suffix.
        view: Name of the view.
        alpha: Opacity that every surface was given; None: the materials' own.
        width: Pixels per row.
        height: Rows.
        triangles: Of the scene.
        fragments: N, transparent fragments.
        occupied: Pixels that have any.
        most: D, fragments of the fullest pixel.
        path_frames: Frames of the camera path that flicker was measured on; 0: it was not.
        yardsticks: Oracle and certified optima.
        cells: Measured by this run.
        driver: OpenGL driver.
        clock: Which clocks times are of.
        machine: Processor, cores, memory, system.
        commit: Of the sources, `-dirty` if they were changed; None if unknown.
        code: Digest of the sources that decide the result.
        created: UTC, ISO 8601.
        seconds: That the view took, all told.
        load: Load average of the machine before and after.
    """

    key: str
    scene: str
    view: str
    alpha: float | None
    width: int = Field(gt=0)
    height: int = Field(gt=0)
    triangles: int = Field(ge=0)
    fragments: int = Field(ge=0)
    occupied: int = Field(ge=0)
    most: int = Field(ge=0)
    path_frames: int = Field(ge=0)
    yardsticks: tuple[Yardstick, ...]
    cells: tuple[BenchCell, ...]
    driver: str
    clock: str
    machine: dict[str, str]
    commit: str | None
    code: str
    created: str
    seconds: float
    load: tuple[float, float]


class BenchResult(_Record):
    """`bench.json`.

    Attributes:
        format: Version of this schema.
        command: The command that makes it again.
        created: UTC, ISO 8601.
        versions: Of Python and the libraries.
        bundle: Name and digest of the bundle; None: `kbuffer-deep` was left out.
        device: What the bounds of frame times are stated for; they follow from the cells' work.
        left_out: What was asked for and could not be measured, a sentence each.
        views: In the order of the command.
    """

    format: Literal["diaphane-bench/1"] = FORMAT
    command: str
    created: str
    versions: dict[str, str]
    bundle: str | None
    device: Device = Device()
    left_out: tuple[str, ...] = ()
    views: tuple[BenchView, ...]
