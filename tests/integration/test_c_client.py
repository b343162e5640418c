"""The C header compiled with a C and a C++ compiler, against bundles of this export: answers, cuts, hostile files."""

from __future__ import annotations

import json
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import safetensors.numpy
from numpy.typing import NDArray
from support.dumps import random_dump
from support.training import random_weights

from renderer.allocation.cuts import Cuts, events_of, solve_cuts
from renderer.allocation.prices import gain_prices, importance_prices, prior_gains, ranks_of
from renderer.features import FEATURES, SUMS, derive, gather
from schemas.bundle import MANIFEST, UBO_DATA, WEIGHTS, WGSL, ParityReport, Provenance, TailSpec, file_spec
from schemas.tail import TAILS, TailName
from trainer.bundle import Description, load_bundle, write_bundle
from trainer.weights import Weights

ROOT = Path(__file__).resolve().parents[2]
CLIENT = ROOT / "deploy" / "client" / "c"
WARNINGS = ("-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wdouble-promotion", "-Wshadow", "-Werror")
SANITIZERS = ("-fsanitize=address,undefined", "-fno-sanitize-recover=all", "-g")
STANDARDS = {"cc": ("-std=c99",), "g++": ("-x", "c++", "-std=c++11")}

pytestmark = pytest.mark.skipif(
    any(shutil.which(name) is None for name in STANDARDS), reason="there is no C compiler: apt-get install gcc g++"
)

NETWORKS: dict[str, tuple[Weights, TailName]] = {
    "default": (random_weights(1, hidden=(32, 16)), "binned-12"),
    "importance": (random_weights(2, FEATURES[:12], (128, 64), "importance"), "binned-16"),
    "density": (random_weights(3, FEATURES[3:30], (64, 32), tail="density-16"), "density-16"),
    "linear": (random_weights(4, FEATURES[:3], (), tail="binned-8"), "binned-8"),
}


@pytest.fixture(scope="module")
def sums() -> NDArray[np.float32]:
    """Raw sums of pixels with fragments, float32 [pixels, 48]."""
    dump = random_dump(40, 40, 12, seed=1)
    return gather(dump, "binned-16")[dump.counts > 0]


def export(folder: Path, weights: Weights, tail: TailName, features: NDArray[np.float32]) -> Path:
    """A bundle whose forms nobody compared: that takes a GL context and is tested elsewhere."""
    provenance = Provenance(scenes={}, code_version="0", seed=0, machine='a "machine" \\ ö')
    described = Description("glass", TailSpec(name=tail, g=0.75), "display", provenance, {"deep": [[[1.5e-3]]]})
    parity = ParityReport(count=1, tolerance=1e-5, torch_onnx=0.0, torch_glsl=0.0, torch_ubo=0.0, driver="none")
    write_bundle(folder, weights, described, features, lambda: parity)
    return folder


@pytest.fixture(scope="module")
def bundles(tmp_path_factory: pytest.TempPathFactory, sums: NDArray[np.float32]) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("bundles")
    return {name: export(folder / name, *network, derive(sums)) for name, network in NETWORKS.items()}


@pytest.fixture(scope="module")
def probe(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., str]:
    """Runs the probe, with sanitizers that end it at the first fault."""
    program = tmp_path_factory.mktemp("probe") / "probe"
    source = ROOT / "tests" / "support" / "client_probe.c"
    options = ("-std=c99", "-O1", *WARNINGS, *SANITIZERS, f"-I{CLIENT}")
    subprocess.run(["cc", *options, "-o", program, source, "-lm"], check=True)

    def run(*words: object) -> str:
        done = subprocess.run([program, *map(str, words)], capture_output=True, text=True)
        assert done.returncode == 0, done.stderr[-4000:]
        return done.stdout

    return run


@pytest.mark.parametrize("compiler", STANDARDS)
def test_the_example_tests_a_bundle(bundles: dict[str, Path], tmp_path: Path, compiler: str) -> None:
    program = tmp_path / "example"
    options = (*STANDARDS[compiler], "-O1", *WARNINGS)
    subprocess.run([compiler, *options, "-o", program, CLIENT / "example.c", "-lm"], check=True)
    for name, folder in bundles.items():
        done = subprocess.run([program, folder], capture_output=True, text=True)
        assert done.returncode == 0, done.stdout + done.stderr
        weights, tail = NETWORKS[name]
        assert f"glass: tail {tail} of {TAILS[tail].bins} bins, metric display, 11 files\n" in done.stdout
        assert f"reads: {' '.join(weights.features)}\n" in done.stdout
        assert f"answers: {' '.join(weights.outputs)}\nself-test: passed\n" in done.stdout
    assert subprocess.run([program, tmp_path], capture_output=True, text=True).stderr.startswith("there is no manifest")


@pytest.mark.parametrize("name", NETWORKS)
def test_features_and_answers_are_those_of_the_trainer(
    bundles: dict[str, Path], probe: Callable[..., str], tmp_path: Path, sums: NDArray[np.float32], name: str
) -> None:
    weights = load_bundle(bundles[name]).weights
    rows = np.concatenate([sums, np.zeros((1, sums.shape[1]), np.float32)])
    rows.tofile(tmp_path / "sums")
    assert probe("features", bundles[name], tmp_path / "sums", tmp_path / "features") == ""
    found = np.fromfile(tmp_path / "features", np.float32).reshape(len(rows), -1)
    np.testing.assert_allclose(found, derive(rows)[:, weights.columns], rtol=1e-5, atol=1e-5)

    found[:, 0] *= 100.0  # beyond what normalised features are clamped to
    found.tofile(tmp_path / "features")
    assert probe("predict", bundles[name], tmp_path / "features", tmp_path / "answers") == ""
    answers = np.fromfile(tmp_path / "answers", np.float32).reshape(len(rows), -1)
    expected = weights.answer(found)
    assert (np.abs(answers - expected) / np.maximum(1.0, np.abs(expected))).max() <= 1e-5


def test_features_that_are_not_finite_have_no_answer(
    bundles: dict[str, Path], probe: Callable[..., str], tmp_path: Path
) -> None:
    rows = np.zeros((4, len(FEATURES)), np.float32)
    rows[1, 3], rows[3, -1] = np.nan, -np.inf
    rows.tofile(tmp_path / "rows")
    assert probe("predict", bundles["default"], tmp_path / "rows", tmp_path / "answers") == "refused 1\nrefused 3\n"


@pytest.mark.parametrize("name", NETWORKS)
def test_ranks_are_those_of_the_renderer(
    bundles: dict[str, Path], probe: Callable[..., str], tmp_path: Path, name: str
) -> None:
    weights, tail = NETWORKS[name]
    dump, bins = random_dump(40, 40, 12, seed=1), TAILS[tail].bins
    rng, sums = np.random.default_rng(7), gather(dump, tail)[dump.counts > 0]
    counts = np.minimum(rng.poisson(0.8, (len(sums), bins)), 255).astype(np.uint8)
    answers = rng.normal(-2.0, 3.0, (len(sums), len(weights.outputs))).astype(np.float32)
    answers[:, -1] = rng.random(len(sums))
    extremes = [np.nan, 0.0, 1.0] if weights.head == "importance" else [np.nan, np.inf, -np.inf, 3e38, 0.0]
    answers[:40] = rng.choice(np.array(extremes, np.float32), answers[:40].shape)
    np.concatenate([answers, sums], axis=1).tofile(tmp_path / "rows")
    counts.tofile(tmp_path / "counts")
    assert probe("ranks", bundles[name], tmp_path / "rows", tmp_path / "counts", tmp_path / "ranks") == ""
    found = np.fromfile(tmp_path / "ranks", np.uint8).reshape(counts.shape)
    if weights.head == "importance":
        expected = ranks_of(importance_prices(answers[:, 0], counts), counts)
    else:
        first, depth = SUMS.index("front_1"), sums[:, SUMS.index("optical_depth")]
        front = np.ones((len(sums), bins + 1), np.float32)
        front[:, 0], front[:, 1:-1] = 0.0, sums[:, first : first + bins - 1]
        prior = prior_gains(front, depth, counts, TAILS[tail])
        expected = ranks_of(gain_prices(answers, prior), counts)
    apart = np.abs(found.astype(int) - expected)
    assert apart.max() <= 1
    assert np.count_nonzero(apart) <= 1e-3 * apart.size  # logarithms that are next to a step
    assert np.mean((expected > 0) & (expected < 255)) > 0.3


Problem = tuple[NDArray[np.uint8], NDArray[np.uint8]]


def cuts_of(probe: Callable[..., str], folder: Path, problem: Problem, budget: int) -> tuple[Cuts, int]:
    """What the client finds, and the sum that it says."""
    pixels, bins = problem[1].shape
    (folder / "ranks").write_bytes(b"".join(part.tobytes() for part in problem))
    complete, rank, total = map(int, probe("cuts", pixels, bins, budget, folder / "ranks", folder / "cuts").split())
    cut, k = np.fromfile(folder / "cuts", np.int32).reshape(2, -1)
    return Cuts(cut, k, None if complete else rank), total


def ranked(seed: int, ranks: tuple[int, int], most: int, bins: int = 12) -> Problem:
    """Pixels of up to `most` fragments a bin, with ranks between two."""
    rng = np.random.default_rng(seed)
    counts = rng.integers(0, most, (3000, bins)) * (rng.random((3000, bins)) < 0.4)
    drawn = np.sort(rng.integers(*ranks, counts.shape, endpoint=True), axis=1)
    return drawn.astype(np.uint8), np.minimum(counts, 255).astype(np.uint8)


@pytest.mark.parametrize(
    "problem",
    [
        pytest.param(ranked(1, (0, 255), 4), id="usual"),
        pytest.param(ranked(2, (100, 100), 2, bins=16), id="ties"),
        pytest.param(ranked(3, (254, 255), 40, bins=8), id="late"),
        pytest.param(ranked(4, (0, 255), 300), id="deep"),
        pytest.param(ranked(5, (0, 0), 9), id="early"),
        pytest.param(tuple(x[:1] for x in ranked(6, (0, 255), 9)), id="one pixel"),
        pytest.param((ranked(7, (0, 255), 9, 8)[0], np.zeros((3000, 8), np.uint8)), id="empty"),
    ],
)
def test_cuts_are_those_of_the_shaders_twin(probe: Callable[..., str], tmp_path: Path, problem: Problem) -> None:
    events = events_of(*problem)
    usable = int(events.growth.sum())
    for budget in {0, 1, usable // 3, usable // 2, max(usable - 1, 0), usable, 2 * usable}:
        found, total = cuts_of(probe, tmp_path, problem, budget)
        expected = solve_cuts(events, budget)
        np.testing.assert_array_equal(found.cut, expected.cut)
        np.testing.assert_array_equal(found.k, expected.k)
        assert found.rank == expected.rank
        assert total == found.k.sum() <= budget


# What is wrong with a bundle -> what the reader says.
Damage = Callable[[Path], object]


def edit(change: Callable[[dict[str, Any]], object]) -> Damage:
    def damage(folder: Path) -> None:
        manifest = json.loads((folder / MANIFEST).read_text())
        change(manifest)
        (folder / MANIFEST).write_text(json.dumps(manifest))

    return damage


def set_to(value: object, *keys: str | int) -> Damage:
    def change(manifest: Any) -> None:
        for key in keys[:-1]:
            manifest = manifest[key]
        manifest[keys[-1]] = value

    return edit(change)


def reweighed(change: Callable[[bytes], bytes]) -> Damage:
    """Other weights, listed with their own size and hash."""

    def damage(folder: Path) -> None:
        (folder / WEIGHTS).write_bytes(change((folder / WEIGHTS).read_bytes()))
        set_to(file_spec(folder / WEIGHTS).model_dump(), "files", WEIGHTS)(folder)

    return damage


def text(change: Callable[[str], str]) -> Damage:
    return lambda folder: (folder / MANIFEST).write_text(change((folder / MANIFEST).read_text()))


LONG = (1 << 40).to_bytes(8, "little")
NAN = np.float32(np.nan).tobytes()
DAMAGED: dict[str, tuple[Damage, str]] = {
    "no manifest": (lambda folder: (folder / MANIFEST).unlink(), "there is no manifest.json"),
    "empty": (text(lambda _: ""), "no JSON"),
    "cut": (text(lambda whole: whole[:-3]), "no JSON"),
    "more after it": (text(lambda whole: whole + "{}"), "no JSON"),
    "a zero byte": (text(lambda whole: whole + "\0"), "no JSON"),
    "deep": (text(lambda _: "[" * 100_000), "nested more than 64 deep"),
    "huge": (text(lambda whole: whole + " " * (1 << 20)), "more than 1048576 bytes"),
    "an array": (text(lambda _: "[1]"), "keys of a bundle"),
    "unknown key": (set_to(1, "extra"), "keys of a bundle"),
    "key twice": (text(lambda whole: whole.replace('"metric"', '"metric": "display", "metric"')), "keys of a bundle"),
    "key missing": (edit(lambda manifest: manifest.pop("layers")), "keys of a bundle"),
    "format": (set_to("diaphane-bundle/3", "format"), "update this reader"),
    "name": (set_to("../glass", "name"), "name"),
    "long name": (set_to("g" * 65, "name"), "name"),
    "tail": (set_to("density-32", "tail", "name"), "tail"),
    "tail without bins": (set_to("density", "tail", "name"), "without depth bins"),
    "head": (set_to("gain", "head"), "head"),
    "outputs": (set_to(["prior"], "outputs"), "outputs"),
    "order": (edit(lambda manifest: manifest["outputs"].reverse()), "outputs"),
    "another tail's outputs": (set_to("binned-8", "tail", "name"), "outputs"),
    "feature": (set_to("colour", "features", 0, "name"), "feature 0"),
    "feature twice": (set_to("log_n", "features", 1, "name"), "feature 1"),
    "no features": (set_to([], "features"), "features"),
    "nan": (text(lambda whole: whole.replace('"mean": ', '"mean": NaN, "m": ', 1)), "no JSON"),
    "infinite": (text(lambda whole: whole.replace('"mean": ', '"mean": 1e999, "m": ', 1)), "feature 0"),
    "infinite float": (set_to(1e300, "features", 0, "std"), "log_n"),
    "spread": (set_to(0.0, "features", 0, "std"), "log_n"),
    "tiny spread": (set_to(1e-60, "features", 0, "std"), "log_n"),
    "units": (set_to([1 << 40, 16], "hidden"), "hidden layer"),
    "fraction": (set_to([32.5, 16], "hidden"), "hidden layer"),
    "depth": (set_to([1] * 9, "hidden"), "hidden"),
    "other units": (set_to([32, 17], "hidden"), "layer1.weight"),
    "files": (edit(lambda manifest: manifest["files"].pop(UBO_DATA)), "files"),
    "path": (edit(lambda m: m["files"].update({"../x": m["files"].pop(WGSL)})), WGSL),
    "size": (set_to(1 << 50, "files", WEIGHTS, "bytes"), WEIGHTS),
    "negative": (set_to(-1, "files", WEIGHTS, "bytes"), WEIGHTS),
    "sha": (set_to("0" * 63 + "G", "files", WEIGHTS, "sha256"), "hexadecimal"),
    "self-test": (set_to([[1.0]], "self_test", "features"), "self-test"),
    "no self-test": (set_to(None, "self_test"), "self-test"),
    "changed": (lambda folder: (folder / WGSL).write_text("x"), WGSL),
    "missing": (lambda folder: (folder / UBO_DATA).unlink(), UBO_DATA),
    "longer": (lambda folder: (folder / WGSL).open("a").write("x"), WGSL),
    "folder": (lambda folder: ((folder / WGSL).unlink(), (folder / WGSL).mkdir()), WGSL),
    "cut weights": (lambda folder: (folder / WEIGHTS).write_bytes(b"cut"), "size or sha256"),
    "no weights": (reweighed(lambda _: b""), "is cut"),
    "short header": (reweighed(lambda whole: whole[:40]), "is cut"),
    "long header": (reweighed(lambda whole: LONG + whole[8:]), "header is too long"),
    "short payload": (reweighed(lambda whole: whole[:-4]), "tensors of the manifest"),
    "offsets": (reweighed(lambda whole: whole.replace(b"[0,128]", b"[8,128]")), "layer 0"),
    "beyond": (reweighed(lambda whole: whole.replace(b"[0,128]", b"[9e9,9]")), "layer 0"),
    "header": (reweighed(lambda whole: whole.replace(b"[0,128]", b"[0,128}")), "damaged header"),
    "dtype": (reweighed(lambda whole: whole.replace(b'"F32"', b'"F16"', 1)), "layer 0"),
    "nan weight": (reweighed(lambda whole: whole[:-4] + NAN), "not finite"),
}


def test_damaged_bundles_are_refused_with_a_reason(
    bundles: dict[str, Path], probe: Callable[..., str], tmp_path: Path
) -> None:
    folders = {name: tmp_path / str(number) for number, name in enumerate(DAMAGED)}
    for name, (damage, _) in DAMAGED.items():
        shutil.copytree(bundles["default"], folders[name])
        damage(folders[name])
    said = probe("check", bundles["default"], *folders.values()).splitlines()
    assert said.pop(0) == "ok glass: passed"
    expected = {name: reason for name, (_, reason) in DAMAGED.items()}
    found = dict(zip(DAMAGED, said, strict=True))
    assert {name: line for name, line in found.items() if line.startswith("ok") or expected[name] not in line} == {}


def test_a_wrong_weight_fails_the_self_test(
    bundles: dict[str, Path], tmp_path: Path, probe: Callable[..., str]
) -> None:
    folder = tmp_path / "bundle"
    shutil.copytree(bundles["default"], folder)
    tensors = safetensors.numpy.load_file(folder / WEIGHTS)
    tensors["layer2.bias"] += np.float32(1e-2)
    reweighed(lambda _: safetensors.numpy.save(tensors))(folder)
    assert probe("check", folder).startswith("ok glass: row 0, output")


@pytest.mark.parametrize("name", ["default", "importance"])
def test_hundreds_of_mutations_end_without_a_fault(
    bundles: dict[str, Path], probe: Callable[..., str], name: str
) -> None:
    manifests, weights = map(int, probe("fuzz", bundles[name], 7, 400).split())
    assert manifests < 100  # most are refused
    assert 0 < weights < 300  # and of the weights those that are still weights are read
