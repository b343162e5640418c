"""The state of a training on disk: safetensors, no pickle, written atomically."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path

from safetensors import SafetensorError, safe_open
from safetensors.torch import save_file
from torch import Tensor

from trainer.models import Network
from trainer.sgd import Optimiser
from trainer.views import View


@dataclass(frozen=True)
class Step:
    """A validation: the step, its batch's loss, and the geometric mean of error / optimum on held-out views."""

    step: int
    loss: float
    score: float


@dataclass
class Checkpoint:
    """Where a training stands, apart from the model and the optimiser.

    Attributes:
        step: Steps done.
        best: State of the model with the best score.
        best_score: That score; infinite before the first validation.
        history: Every validation.
        hardness: How far each training view was from its optimum at the last validation, where that decides how
            often it is drawn; else empty.
    """

    step: int
    best: dict[str, Tensor]
    best_score: float
    history: list[Step]
    hardness: list[float] = field(default_factory=list)

    @classmethod
    def fresh(cls, model: Network) -> Checkpoint:
        """Before the first step."""
        return cls(0, _copy(model), float("inf"), [])

    def is_stale(self, patience: int) -> bool:
        """Whether the last `patience` validations (> 0) found nothing better than before them."""
        scores = [entry.score for entry in self.history]
        return len(scores) > patience > 0 and min(scores[:-patience]) <= min(scores[-patience:])

    def record(self, model: Network, loss: float, score: float) -> None:
        """Note a validation, and the model if none was better."""
        self.history.append(Step(self.step, loss, score))
        if score < self.best_score:
            self.best, self.best_score = _copy(model), score


def data_key(config: str, views: Sequence[View]) -> str:
    """sha256 of a configuration and its data: a checkpoint is only continued under the same."""
    hasher = hashlib.sha256(config.encode())
    for view in views:
        hasher.update(view.digest())
    return hasher.hexdigest()


def save_checkpoint(path: Path, key: str, state: Checkpoint, model: Network, optimiser: Optimiser) -> None:
    """Write the state to a temporary name, then rename: a kill leaves the old or the new file, whole."""
    tensors = {f"model.{name}": value for name, value in model.state_dict().items()}
    tensors |= {f"best.{name}": value for name, value in state.best.items()}
    tensors |= {f"optimiser.{name}": value for name, value in optimiser.state().items()}
    info = {
        "step": state.step,
        "best_score": state.best_score,
        "history": [asdict(entry) for entry in state.history],
        "hardness": state.hardness,
    }
    temporary = path.with_name(f"{path.name}.part")
    save_file(
        {name: value.detach().clone().contiguous() for name, value in tensors.items()},
        temporary,
        metadata={"key": key, "state": json.dumps(info)},
    )
    with temporary.open("rb") as file:
        os.fsync(file.fileno())
    temporary.replace(path)


def load_checkpoint(path: Path, key: str, model: Network, optimiser: Optimiser) -> Checkpoint | None:
    """Restore model and optimiser; None, and nothing changed, if no checkpoint of this key can be read."""
    try:
        with safe_open(path, framework="pt") as file:
            metadata = file.metadata() or {}
            if metadata.get("key") != key:
                return None
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118 - not a dict
    except (FileNotFoundError, SafetensorError):
        return None
    model.load_state_dict(_under(tensors, "model."))
    info = json.loads(metadata["state"])
    optimiser.restore(_under(tensors, "optimiser."), info["step"])
    history = [Step(**entry) for entry in info["history"]]
    return Checkpoint(info["step"], _under(tensors, "best."), info["best_score"], history, info["hardness"])


def _under(tensors: dict[str, Tensor], prefix: str) -> dict[str, Tensor]:
    return {name.removeprefix(prefix): value for name, value in tensors.items() if name.startswith(prefix)}


def _copy(model: Network) -> dict[str, Tensor]:
    return {name: value.detach().clone() for name, value in model.state_dict().items()}
