"""A bundle for the suite, trained on none of its scenes.

python -m benchmarks.comparing.bundle FOLDER --scenes ../shared/scenes --work WORK

Views, labels and their keeping are those of `benchmarks.predictors`; both can share `--work`, one after the other.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np

from benchmarks.comparing.scenes import SHARED
from benchmarks.predicting.labels import labels_of
from benchmarks.predicting.store import Store
from benchmarks.predicting.views import ViewRow, views_of
from labeller.shards import read_shard
from renderer.context import gl_context
from renderer.samples import SAMPLES
from renderer.samples.deep import DEEP
from schemas.bundle import Provenance, TailSpec
from schemas.network import DEFAULT_NETWORK, SIZES, NetworkSize
from schemas.tail import DEFAULT_TAIL, DENSITY_G, TAILS, TailName
from services.versions import commit, machine
from trainer.bundle import Description, export_bundle
from trainer.config import TrainConfig
from trainer.dataset import view_data
from trainer.train import train

SIZE = (715, 480)
VIEWS = 2
"""Of a stage, in each mode."""
_PARITY_ROWS = 100_000


def main() -> int:
    """Trains and exports."""
    given = _parse()
    store = Store(given.work)
    rows = [row for row in views_of(store, given.scenes, SIZE, VIEWS) if row.asset not in {*SHARED, *SAMPLES, *DEEP}]
    if not rows:
        print("There is no scene to train on beside those of the suite.", file=sys.stderr)
        return 1
    export(store, rows, given.network, given.tail, given.folder)
    print(given.folder)
    return 0


def export(store: Store, rows: list[ViewRow], network: NetworkSize, tail: TailName, folder: Path) -> None:
    """Train on views and write the bundle.

    Args:
        store: Where labels are kept.
        rows: The views.
        network: Size of the network.
        tail: That the bundle is for.
        folder: The bundle.
    """
    shards = [read_shard(labels_of(store, row, tail).shard) for row in rows]
    views = [view_data(shard, row.asset) for shard, row in zip(shards, rows, strict=True) if len(shard.n)]
    config = TrainConfig.sized(network)
    result = train(views, (), config)
    features = np.concatenate([view.features for view in views])
    description = Description(
        name=f"suite-{network}",
        tail=TailSpec(name=tail, g=DENSITY_G),
        metric="display",
        k_min=1,
        provenance=Provenance(
            scenes={row.asset: row.digest for row in rows},
            code_version=commit() or "unknown",
            seed=config.seed,
            machine=", ".join(machine().values()),
            settings={"training": config.model_dump(mode="json"), "views": len(views)},
        ),
        evaluation={"training": {"over_optimum": result.score}},
    )
    export_bundle(folder, result.weights, description, features[:: max(1, len(features) // _PARITY_ROWS)], gl_context())


def _parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="Where the bundle goes.")
    parser.add_argument("--scenes", type=Path, required=True, help="Folder with MANIFEST.json.")
    parser.add_argument("--work", type=Path, required=True, help="Where dumps and labels are kept.")
    parser.add_argument("--network", choices=SIZES, default=DEFAULT_NETWORK)
    parser.add_argument("--tail", choices=TAILS, default=DEFAULT_TAIL)
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
