"""What a training depends on, beside its data, and the presets of it."""

from __future__ import annotations

from typing import Any, Final, Literal

from pydantic import BaseModel, ConfigDict, Field

from renderer.features import FEATURES, reads_luma
from schemas.network import NetworkSize
from trainer.dataset import GROUP

Preset = Literal["bin-gains", "paper", "paper-repaired"]

PRESETS: Final[dict[Preset, dict[str, Any]]] = {
    "bin-gains": {},
    "paper": {"batch": 512, "lr": 1e-3, "hidden": (128, 64), "steps": 6000, "validate_every": 1000},
    "paper-repaired": {"batch": 512, "lr": 1e-3, "hidden": (128, 64), "steps": 6000, "validate_every": 1000},
}
"""Settings of each preset that differ from the defaults; what else a preset decides is in `trainer.heads`."""

READ: Final = tuple(name for name in FEATURES if not name.startswith(("background_", "mean_")))
"""Features that help to tell the gain of bins; what lies behind, and where in its bin the optical depth is, does not
(benchmarks/TRIALS.md)."""

SIZES: Final[dict[NetworkSize, dict[str, Any]]] = {
    "tiny": {"hidden": (16,), "features": tuple(name for name in READ if not reads_luma([name]))},
    "small": {},
    "full": {"hidden": (64, 32), "steps": 4000},
}
"""Settings of each size that differ from the defaults; `benchmarks.predictors` measures them. `tiny` reads the depth
bins and what a frame has anyway, so that no luma is gathered."""


class TrainConfig(BaseModel):
    """What a training depends on, beside its data.

    Attributes:
        preset: Network, loss, optimiser and fill, see docs/TRAINING.md; `TrainConfig.of` sets the rest to match.
        seed: Seed of the initial weights and of the batches.
        steps: Steps of the optimiser. Longer training fits the training assets better and held-out ones no better,
            some worse.
        batch: Rows per step.
        lr: First learning rate; that of `bin-gains` falls along a cosine.
        hidden: Units of the hidden layers.
        features: Features that a `bin-gains` network may read.
        view_weight: Share of the loss that is the views' regret (sum of squares) rather than the rows' logarithm.
        leak: Weight of prices that are on the wrong side.
        validate_every: Steps between validations.
        validation_rows: Rows of each validation view that are scored.
        patience: Validations without a better score after which the training stops; 0: it never does, and no asset
            is kept out for that.
        folds: One of how many training assets decides when to stop, and which state is kept.
        replay_share: How often a group of rows is one of the data set that is replayed, if there is one.
        mining: How often a view is drawn by how far it was from its optimum at the last validation; else all alike.
        feature_noise: Noise on the inputs, as a multiple of each feature's spread.
        pool_rows: Rows of the training views that are in memory at a time.
        pool_steps: Steps until other rows take their place, where there are more.
        threads: Threads of torch. One is nearly as fast for so small a network, and does not depend on the machine.
        checkpoint_seconds: Time between checkpoints.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    preset: Preset = "bin-gains"
    seed: int = 0
    steps: int = Field(default=1500, gt=0)
    batch: int = Field(default=4096, ge=GROUP)
    lr: float = Field(default=4e-3, gt=0.0)
    hidden: tuple[int, ...] = (32,)
    features: tuple[str, ...] = READ
    view_weight: float = Field(default=0.5, ge=0.0, le=1.0)
    leak: float = Field(default=0.02, ge=0.0)
    validate_every: int = Field(default=500, gt=0)
    validation_rows: int = Field(default=20_000, gt=0)
    patience: int = Field(default=0, ge=0)
    folds: int = Field(default=5, ge=2)
    replay_share: float = Field(default=0.5, ge=0.0, le=1.0)
    mining: float = Field(default=0.0, ge=0.0, le=1.0)
    feature_noise: float = Field(default=0.0, ge=0.0)
    pool_rows: int = Field(default=4_000_000, gt=0)
    pool_steps: int = Field(default=100, gt=0)
    threads: int = Field(default=1, gt=0)
    checkpoint_seconds: float = Field(default=10.0, gt=0.0)

    @classmethod
    def of(cls, preset: Preset, **changes: Any) -> TrainConfig:
        """The settings of a preset, some changed."""
        return cls(**{"preset": preset, **PRESETS[preset], **changes})

    @classmethod
    def sized(cls, size: NetworkSize, **changes: Any) -> TrainConfig:
        """The settings of a `bin-gains` network of a size, some changed."""
        return cls(**{**SIZES[size], **changes})

    @property
    def decisive(self) -> str:
        """The settings that decide the result, JSON: a checkpoint of other ones is not continued."""
        return self.model_dump_json(exclude={"checkpoint_seconds"})
