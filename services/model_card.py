"""The model card of a bundle: what people should know before they use it, in Markdown, for every bundle alike.

It depends on the manifest and on measured errors alone, not on times, paths or when it was written: the same bundle,
measured on the same pictures, has the same card.
"""

from __future__ import annotations

import shlex
from collections.abc import Iterable, Mapping, Sequence
from pathlib import PurePath

from evaluation import summary
from evaluation.wording import counted
from schemas.bundle import Manifest
from schemas.flags import written
from schemas.licence import commercial_use, verdict
from schemas.measurement import Measurement
from stages.plan import Plan

_WORST_SCENES = 5
_WORST_CELLS = 8

_PURPOSE = """\
It predicts, for each pixel of a frame with order-independent transparency, how many of its nearest depth bins are worth
sorting exactly within a budget of fragments (technique `kbuffer-deep`); the tail averages the others. It is for
real-time renderers whose transparency has to fit a memory budget, with surfaces like those that it was trained on. It
is not for scenes whose fragments all fit the budget, where every exact technique is as good and simpler, and not for
volumes or refraction, which are no layers of a pixel."""

_LIMITS = """\
- **That it does as well on other scenes.** Errors hold for the views named here; other content, opacities, resolutions
  and budgets were not measured. `diaphane bench SCENE --bundle FOLDER` measures yours.
- **That it is exact.** Only the core is; where the tail averages, an error remains, and it may flicker in motion.
- **That it is fast on a graphics card.** Errors and bytes are the same on every driver; the time of a frame is not, and
  is no part of this card.
- **That other tails do as well.** A network is for the tail that it was trained with.
- **That licences are cleared.** They are quoted as the scenes state them, sorted by their words; no one has examined
  whether a network is bound by the licences of the scenes that it was trained on."""


def model_card(manifest: Manifest, command: str, measurements: Sequence[Measurement]) -> str:
    """The card.

    Args:
        manifest: Of the bundle.
        command: That makes the bundle again.
        measurements: On scenes that it was not trained on, of the bundle and of techniques without one; may be empty.
    """
    provenance = manifest.provenance
    parts = [
        f"# Model card: {manifest.name}",
        f"**{verdict(provenance.scenes, provenance.licences)}**",
        f"## What it is for\n\n{_PURPOSE}",
        _scenes("Training scenes", provenance.scenes, provenance.licences),
        _measured(measurements, manifest),
        _failures(measurements),
        _making(manifest, command),
        f"## What must not be claimed\n\n{_LIMITS}",
    ]
    return "\n\n".join(parts) + "\n"


def command_of(plan: Plan) -> str:
    """The command that builds a bundle again, with the scenes' files by name."""
    named = [scene for scene in plan.scenes if scene.source.root]
    parts = ["diaphane", "build", *(PurePath(scene.source.root).name for scene in named), "--name", plan.name]
    for scene in named:
        parts += ["--holdout", PurePath(scene.source.root).name] if scene.held_out else []
    parts += ["--from", f"sha256:{plan.start.digest[:12]}"] if plan.start is not None else []
    return shlex.join([*parts, *written(plan.options)])


def _scenes(title: str, scenes: Mapping[str, str], licences: Mapping[str, str]) -> str:
    rows = [
        (name, licences.get(name) or "unknown: none is stated", commercial_use(licences.get(name, "")), digest[:12])
        for name, digest in sorted(scenes.items())
    ]
    return f"## {title}\n\n{_table(('scene', 'licence and attribution', 'commercial use', 'sha256'), rows)}"


def _measured(measurements: Sequence[Measurement], manifest: Manifest) -> str:
    if not summary.ratios(measurements, summary.BUNDLE, summary.BASELINE):
        nothing = "Nothing: no view of a held-out scene was compared, so no claim about its error is founded."
        return f"## What it was measured on\n\n{nothing}"
    bounded = [m for m in measurements if m.technique in (summary.BUNDLE, summary.BASELINE, summary.ORACLE)]
    views = {(m.scene, m.view) for m in bounded}
    scenes = sorted({m.scene for m in bounded})
    stated = manifest.provenance.licences
    held = [f"{name} ({stated[name]})" if name in stated else name for name in scenes]
    rows = [
        (
            f"{row.budget_factor:g}",
            str(row.averaged),
            summary.number(None if row.mse is None else row.mse * 1e5),
            summary.number(row.over_baseline),
            summary.number(_over(measurements, row.budget_factor)),
            summary.number(row.psnr),
            summary.number(row.flip),
        )
        for row in summary.rows(bounded)
        if row.technique == summary.BUNDLE
    ]
    heads = ("F / (W H)", "views", "MSE x1e-5", "/ VKB", "/ optimum", "PSNR dB", "FLIP")
    return "\n\n".join(
        (
            "## What it was measured on",
            f"{counted(len(views), 'views')} of {counted(len(scenes), 'scenes')} that it was not "
            f"trained on: {_escaped(', '.join(held))}. "
            f"Pictures of {_sizes(bounded)} are compared with the exact one as displayed. VKB (`{summary.BASELINE}`) "
            "and the certified optimal allocation have the same tail and budget. Views whose fragments all fit one "
            "of these budgets are in no row; errors and ratios are geometric means.",
            _table(heads, rows),
            summary.sentence(measurements),
        )
    )


def _failures(measurements: Sequence[Measurement]) -> str:
    cells = _cells(measurements)
    if not cells:
        return "## Where it fails\n\nNot known: nothing was measured."
    scenes = {scene for scene, _, _ in cells}
    by_scene = {
        scene: summary.geometric_mean([ratio for key, ratio in cells.items() if key[0] == scene]) or 0.0
        for scene in scenes
    }
    worst = sorted(by_scene.items(), key=lambda pair: (-pair[1], pair[0]))[:_WORST_SCENES]
    least = sorted(cells.items(), key=lambda pair: (-pair[1], pair[0]))[:_WORST_CELLS]
    worse = sum(ratio > 1.0 for ratio in cells.values())
    lost = "In none of" if not worse else f"In {worse} of"
    return "\n\n".join(
        (
            "## Where it fails",
            f"{lost} {len(cells)} cells (scene, view, budget) its squared error is more than VKB's. The worst scenes:",
            _table(("scene", "/ VKB"), [(scene, summary.number(ratio)) for scene, ratio in worst]),
            "The worst cells:",
            _table(
                ("scene", "view", "F / (W H)", "/ VKB"),
                [(scene, view, f"{budget:g}", summary.number(ratio)) for (scene, view, budget), ratio in least],
            ),
        )
    )


def _making(manifest: Manifest, command: str) -> str:
    provenance = manifest.provenance
    units = "-".join(map(str, manifest.hidden)) or "none"
    return "\n".join(
        (
            "## How it was made",
            "",
            "```",
            command,
            "```",
            "",
            f"- Tail: `{manifest.tail.name}`, error measured on {manifest.metric} values",
            f"- Features: {', '.join(manifest.feature_names)}",
            f"- Network: {manifest.head}, hidden units {units}, {manifest.weight_count:,} weights",
            f"- Seed: {provenance.seed}",
            *_trained(manifest),
            f"- Code: `{provenance.code_version}`",
            f"- Machine: {provenance.machine}; {manifest.parity.driver}",
        )
    )


def _trained(manifest: Manifest) -> list[str]:
    training = manifest.evaluation.get("training")
    found = training.get("over_optimum") if isinstance(training, dict) else None
    if not isinstance(found, float):
        return []
    return [f"- Squared error over the optimum while training, which says nothing of other scenes: {found:.3g}"]


def _cells(measurements: Iterable[Measurement]) -> dict[tuple[str, str, float], float]:
    """Scene, view and budget -> squared error of the bundle over VKB's, with the floor of `summary.ratios`."""
    table: dict[str, dict[tuple[str, str, float], float]] = {summary.BUNDLE: {}, summary.BASELINE: {}}
    for m in summary.compared(measurements):
        if m.technique in table:
            table[m.technique][m.scene, m.view, m.budget_factor] = max(m.mse or 0.0, summary.MSE_FLOOR)
    own, baseline = table[summary.BUNDLE], table[summary.BASELINE]
    # Where neither is above the floor both are lossless, and there is nothing to compare.
    return {
        key: own[key] / baseline[key]
        for key in own.keys() & baseline.keys()
        if max(own[key], baseline[key]) > summary.MSE_FLOOR
    }


def _over(measurements: Sequence[Measurement], factor: float) -> float | None:
    """Error over that of the optimal allocation at a budget."""
    same = [m for m in measurements if m.budget_factor == factor]
    return summary.geometric_mean(summary.ratios(same, summary.BUNDLE, summary.ORACLE))


def _sizes(measurements: Iterable[Measurement]) -> str:
    settings = {(m.width, m.height, m.alpha) for m in measurements}
    words = sorted(f"{w}x{h}, {'authored opacities' if a is None else f'alpha {a:g}'}" for w, h, a in settings)
    return "; ".join(words)


def _table(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = [heads, ["---"] * len(heads), *([_escaped(cell) for cell in row] for row in rows)]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def _escaped(text: str) -> str:
    """Text of a stranger's scene as Markdown shows it, whatever is in it."""
    return "".join(f"\\{c}" if c in "\\`*[]<>|" else c for c in text)
