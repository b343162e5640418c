"""The project's pretrained bundle, trained on none of the suite's scenes and only on those that a company may ship.

python -m benchmarks.comparing.bundle FOLDER --scenes ../shared/scenes --scenes ../shared/training-scenes --work WORK
python -m benchmarks.comparing.bundle FOLDER --card-only

A stage is captured as authored, with one opacity for all surfaces, and with an opacity of its own for each material;
its training rows stay in `--work`. The bundle has a model card, with what the committed results of the suite
(`make bench`) say of this very network: `--card-only` writes it anew when these have changed, and trains nothing.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from benchmarks.casting.cases import Case, described_cases
from benchmarks.comparing.measured import RESULTS, measurements_of, read_lines
from benchmarks.comparing.scenes import SHARED
from evaluation.bench.cells import bundle_of
from evaluation.versions import commit, machine
from labeller.curves import error_curves, whole_bins
from labeller.hull import lower_hulls
from labeller.shards import read_shard, write_shard
from renderer.capture import capture
from renderer.context import gl_context
from renderer.frame import Frame
from renderer.gpu_scene import GpuScene
from renderer.opacities import drawn_opacities
from renderer.scene import LoadOptions, load_scene, scene_digest
from schemas.bundle import Provenance, TailSpec, load_manifest, write_card
from schemas.licence import commercial_use, tidy
from schemas.network import DEFAULT_NETWORK, SIZES, NetworkSize
from schemas.problem import Problem
from schemas.scene import SceneArrays
from schemas.tail import BINNED_TAILS, DEFAULT_TAIL, DENSITY_G, TailName
from services.model_card import model_card
from trainer.bundle import Description, export_bundle
from trainer.config import TrainConfig
from trainer.dataset import ViewData, view_data
from trainer.train import train

SIZE: Final = (715, 480)
VIEWS: Final = 2
"""Of a stage, in each mode."""
STAGES: Final = 3
"""Most stages of a scene: some have many small ones, and every asset weighs the same anyway."""
MODES: Final = ("authored", "alpha .33", "materials")
MULTIPLES: Final = (0.125, 0.25, 0.5, 1.0, 2.0, 4.0)
"""Budgets that prices are drawn near, as multiples of width x height, where they hold no more than HELD of N."""
HELD: Final = 0.95
LEAST_FRAGMENTS: Final = 0.15
"""Views with fewer fragments per pixel teach little."""
STEPS: Final = 4000
"""Of the training: more than a build takes for its few scenes, 4 % of the error less (benchmarks/TRIALS.md)."""
_PARITY_ROWS: Final = 100_000


@dataclass(frozen=True, slots=True)
class Source:
    """A scene that may be trained on.

    Attributes:
        case: One of its stages.
        licence: As its description states it.
    """

    case: Case
    licence: str


def sources(folders: list[Path]) -> Iterator[Source]:
    """The stages that may be trained on, and under which licence."""
    for folder in folders:
        described = json.loads((folder / "MANIFEST.json").read_text(encoding="utf-8"))["scenes"]
        licences = {scene["name"]: str(scene["licence"]) for scene in described}
        seen: dict[str, int] = {}
        for case in described_cases(folder):
            licence = licences[case.scene]
            seen[case.scene] = seen.get(case.scene, 0) + 1
            if case.scene in SHARED or seen[case.scene] > STAGES or commercial_use(licence) != "allowed":
                continue
            yield Source(case, tidy(licence))


def rows_of(case: Case, tail: TailName, work: Path) -> list[ViewData]:
    """Training rows of a stage in every mode; what was labelled before is read."""
    found = []
    for mode in MODES:
        done = work / f"{case.scene}-{case.path.stem}-{mode}-{tail}.json".replace(" ", "")
        if not done.exists():
            names = [str(path.name) for path in _label(case, mode, tail, work)]
            done.write_text(json.dumps(names), encoding="utf-8")
        found += [view_data(read_shard(work / name), case.scene) for name in json.loads(done.read_text("utf-8"))]
    return [view for view in found if view.rows]


def _label(case: Case, mode: str, tail: TailName, work: Path) -> Iterator[Path]:
    print(f"{case.scene} {case.path.name} {mode}", file=sys.stderr, flush=True)
    try:
        scene = _loaded(case, mode)
    except Problem as problem:
        print(problem.title, file=sys.stderr, flush=True)
        return
    if scene.is_opaque:
        return
    gpu = GpuScene(gl_context(), scene)
    for number, view in enumerate(case.cameras(scene, VIEWS)):
        dump = capture(Frame(gpu, view, *SIZE)).dump
        if dump.total < LEAST_FRAGMENTS * dump.pixels:
            continue
        curves = whole_bins(dump, error_curves(dump, tail))
        budgets = [int(m * dump.pixels) for m in MULTIPLES if m * dump.pixels < HELD * dump.total]
        path = work / f"{case.scene}-{case.path.stem}-{mode}-{tail}-{number}.safetensors".replace(" ", "")
        write_shard(path, dump, curves, lower_hulls(curves), budgets)
        yield path


def _loaded(case: Case, mode: str) -> SceneArrays:
    if mode == "materials":
        scene = load_scene(case.path, LoadOptions(alpha=0.5, variants=case.variants))
        return drawn_opacities(scene, seed=sum(map(ord, case.scene)))
    return load_scene(case.path, LoadOptions(alpha=0.33 if mode != "authored" else None, variants=case.variants))


def export(chosen: list[Source], network: NetworkSize, tail: TailName, work: Path, folder: Path) -> None:
    """Train and write the bundle.

    Args:
        chosen: What to train on.
        network: Size of the network.
        tail: That the bundle is for.
        work: Where labels are kept.
        folder: The bundle.
    """
    work.mkdir(parents=True, exist_ok=True)
    views = [view for source in chosen for view in rows_of(source.case, tail, work)]
    config = TrainConfig.sized(network, steps=STEPS)
    result = train(views, (), config)
    features = np.concatenate([view.features for view in views])
    taught = {view.asset for view in views}
    description = Description(
        name=f"pretrained-{network}",
        tail=TailSpec(name=tail, g=DENSITY_G),
        metric="display",
        provenance=Provenance(
            scenes={s.case.scene: scene_digest(s.case.path) for s in chosen if s.case.scene in taught},
            licences={s.case.scene: s.licence for s in chosen if s.case.scene in taught},
            code_version=commit() or "unknown",
            seed=config.seed,
            machine=", ".join(machine().values()),
            settings={"training": config.model_dump(mode="json"), "views": len(views), "size": list(SIZE)},
        ),
        evaluation={"training": {"over_optimum": result.score}},
    )
    export_bundle(folder, result.weights, description, features[:: max(1, len(features) // _PARITY_ROWS)], gl_context())


def describe_bundle(folder: Path, results: Path = RESULTS) -> None:
    """Write the model card of the bundle, with what was measured of its network on the suite's scenes.

    Args:
        folder: The bundle.
        results: Folder of the suite's committed results.
    """
    manifest = load_manifest(folder)
    label = bundle_of(folder).label
    found = [read_lines(path) for path in sorted(results.glob("bench-*.jsonl"))]
    measured = [m for result in found if result.bundle == label for m in measurements_of(result, manifest.tail.name)]
    scenes = " ".join(f"--scenes ../shared/{name}" for name in ("scenes", "training-scenes"))
    network = manifest.name.partition("-")[2]
    command = f"python -m benchmarks.comparing.bundle FOLDER {scenes} --work WORK"
    write_card(folder, model_card(manifest, f"{command} --network {network} --tail {manifest.tail.name}", measured))


def main() -> int:
    """Trains and exports, and writes the model card."""
    given = _parse()
    if given.card_only:
        describe_bundle(given.folder)
        return 0
    chosen = list(sources(given.scenes))
    if not chosen:
        print("There is no scene to train on beside those of the suite.", file=sys.stderr)
        return 1
    export(chosen, given.network, given.tail, given.work, given.folder)
    describe_bundle(given.folder)
    print(given.folder)
    return 0


def _parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="Where the bundle goes.")
    parser.add_argument("--scenes", type=Path, action="append", default=[], help="Has MANIFEST.json; repeatable.")
    parser.add_argument("--work", type=Path, default=Path(".diaphane/bundle"), help="Where labels are kept.")
    parser.add_argument("--card-only", action="store_true", help="Train nothing: write the model card of FOLDER anew.")
    parser.add_argument("--network", choices=SIZES, default=DEFAULT_NETWORK)
    parser.add_argument("--tail", choices=BINNED_TAILS, default=DEFAULT_TAIL)
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
