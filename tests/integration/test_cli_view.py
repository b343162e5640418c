"""`diaphane view` without a window: frames, statistics, models of a service, and what it refuses."""

from __future__ import annotations

import csv
import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import moderngl
import numpy as np
import pytest
from PIL import Image
from support.release_server import KEY, ReleaseServer
from support.releases import SIGNER, STRANGER, record_of, serve
from support.training import export_random, random_weights, real_features

from diaphane.cli.app import run
from diaphane_client import server as client_server
from evaluation.bench.rounds import Run
from evaluation.bench.subject import Subject
from evaluation.local_scenes import LocalScene
from evaluation.pictures import write_png
from evaluation.viewer import model
from evaluation.viewer.camera import orbit
from evaluation.viewer.model import Service, remote_source
from evaluation.viewer.studio import Studio
from renderer.samples import SAMPLES
from renderer.scene import LoadOptions
from renderer.techniques import Budget, Needs, technique
from schemas.bench import CellKey
from schemas.bundle import load_manifest
from schemas.bundle_files import bundle_files
from schemas.problem import ExitCode
from schemas.tail import DEFAULT_TAIL

SIZE = (64, 48)


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory, gl: moderngl.Context) -> Path:
    return SAMPLES["nested_shells"](tmp_path_factory.mktemp("scene"))


@pytest.fixture(scope="module")
def bundles(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    folders = []
    for seed in (3, 4):
        folders.append(tmp_path_factory.mktemp("bundle"))
        export_random(folders[-1], random_weights(seed), real_features(64, 5))
    return folders


@pytest.fixture
def server(monkeypatch: pytest.MonkeyPatch) -> Iterator[ReleaseServer]:
    monkeypatch.setattr(client_server, "FIRST_WAIT", 0.001)
    monkeypatch.setenv("DIAPHANE_KEY", KEY)
    found = ReleaseServer()
    yield found
    found.stop()


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("DIAPHANE_STATE", raising=False)
    monkeypatch.delenv("DIAPHANE_URL", raising=False)
    return tmp_path


def publish(server: ReleaseServer, bundle: Path, version: str) -> None:
    files = bundle_files(bundle)
    server.blobs |= {files[name].sha256: (bundle / name).read_bytes() for name in files}
    serve(server, record_of(version, files))


def rows(capsys: pytest.CaptureFixture[str], scene: Path, *arguments: str) -> list[dict[str, Any]]:
    size = f"{SIZE[0]}x{SIZE[1]}"
    assert run(["view", str(scene), "--size", size, "--frames", "1", "--out", "o", *arguments, "--json"]) == ExitCode.OK
    found: list[dict[str, Any]] = json.loads(capsys.readouterr().out)["rows"]
    return found


def pixels(path: Path) -> np.ndarray:
    with Image.open(path) as image:
        return np.asarray(image)


def test_statistics_are_those_of_the_bench(scene: Path, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pair = ("kbuffer", "kbuffer-optimal")
    options = ["--frames", "3", "-t", pair[0], "--against", pair[1], "--budget", "1", "--flip"]
    found = rows(capsys, scene, *options)
    assert [(row["frame"], row["technique"]) for row in found] == [(n, name) for n in range(3) for name in pair]
    local = LocalScene(scene, scene, LoadOptions())
    arrays = local.at(None)
    start = local.views(None, None)[0].view
    budget = Budget(SIZE[0] * SIZE[1], DEFAULT_TAIL)
    for number in (0, 2):
        subject = Subject(local.gpu(), orbit(start, arrays.up, arrays.bounds, number, 3), SIZE)
        for row in found[2 * number : 2 * number + 2]:
            rendered = technique(row["technique"], Needs(allocate=subject.allocate)).render(subject.frame(), budget)
            errors = subject.errors(rendered)
            occupied = rendered.k[subject.dump.counts > 0]
            expected = {
                "mse": errors.mse,
                "mse_display": errors.mse_display,
                "psnr": errors.psnr,
                "flip": errors.flip,
                "fragments": int(subject.dump.counts.sum()),
                "captured": rendered.captured,
                "k_min": int(occupied.min()),
                "k_max": int(occupied.max()),
                "pool_bytes": rendered.pool_bytes,
                "total_bytes": rendered.total_bytes,
                "budget": budget.fragments,
            }
            assert {name: row[name] for name in expected} == expected
            assert row["mse"] > 0.0
            assert row["frame_ms"] == pytest.approx(sum(v for name, v in row.items() if name.startswith("ms_")))
    assert found[0]["fragments"] != found[2]["fragments"]
    with (folder / "o" / "statistics.csv").open(encoding="utf-8", newline="") as stream:
        written = list(csv.DictReader(stream))
    assert [{name: str(value) for name, value in row.items()} for row in found] == [
        {name: written[number][name] for name in row} for number, row in enumerate(found)
    ]


def test_what_learns_from_frame_to_frame_is_shown_as_the_bench_measures_it(
    scene: Path, bundles: list[Path], capsys: pytest.CaptureFixture[str]
) -> None:
    pair = ("kbuffer-temporal", "kbuffer-deep")
    options = ["--bundle", str(bundles[0]), "-t", pair[0], "--against", pair[1], "--budget", "0.5", "--size", "80x60"]
    found = rows(capsys, scene, *options)
    local = LocalScene(scene, scene, LoadOptions())
    local.at(None)
    subject = Subject(local.gpu(), local.views(None, None)[0].view, (80, 60))
    for row in found:
        made = technique(row["technique"], Needs(bundle=bundles[0]))
        cell = Run(CellKey(technique=made.name, basis="none"), made, Budget(2400, row["tail"], row["g"]))
        assert row["mse_display"] == subject.errors(cell.first(subject, 60.0)).mse_display
    assert found[0]["mse_display"] != found[1]["mse_display"]


def test_the_first_frame_is_the_picture_that_render_makes(
    scene: Path, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rows(capsys, scene, "-t", "kbuffer", "--background", "#204060", "--budget", "1")
    picture = pixels(folder / "o" / "frame-0000.png")
    assert picture.shape == (SIZE[1], 2 * SIZE[0], 3)
    options = ["-t", "kbuffer,sbuffer", "--size", "64x48", "--budget", "1", "--background", "#204060", "-o", "r.png"]
    assert run(["render", str(scene), *options]) == ExitCode.OK
    capsys.readouterr()
    assert np.array_equal(picture[:, : SIZE[0]], pixels(folder / "r-kbuffer.png"))
    assert np.array_equal(picture[:, SIZE[0] :], pixels(folder / "r-sbuffer.png"))
    rows(capsys, scene, "-t", "kbuffer", "--layout", "single", "--readout", "--budget", "1")
    assert pixels(folder / "o" / "frame-0000.png").shape == (SIZE[1], SIZE[0], 3)


def test_rows_are_added_to_a_file_of_ones_own(scene: Path, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for _ in range(2):
        rows(capsys, scene, "--layout", "single", "--csv", "all.csv")
    assert len((folder / "all.csv").read_text().splitlines()) == 3
    assert not (folder / "o" / "statistics.csv").exists()


def test_an_interrupt_leaves_the_numbers_of_what_was_rendered(
    scene: Path, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    written = []

    def write(path: Path, image: np.ndarray) -> None:
        if written:
            raise KeyboardInterrupt
        written.append(path.name)
        write_png(path, image)

    monkeypatch.setattr("evaluation.viewer.headless.write_png", write)
    arguments = ["view", str(scene), "--size", "64x48", "--layout", "single", "--frames", "3", "--out", "o"]
    assert run(arguments) == ExitCode.INTERRUPTED
    assert len((folder / "o" / "statistics.csv").read_text().splitlines()) == 2
    assert sorted(path.name for path in (folder / "o").iterdir()) == ["frame-0000.png", "statistics.csv"]


def test_views_of_a_file_are_chosen_by_name(scene: Path, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    views = [{"eye": [0, 0, z], "target": [0, 0, 0], "up": [0, 1, 0], "fov": 40} for z in (50, 500)]
    (folder / "v.json").write_text(json.dumps({"scenes": [{"main": str(scene), "views": views}]}))
    near, far = (rows(capsys, scene, "--views", "v.json", "--view", name)[0] for name in ("view0", "view1"))
    assert near["fragments"] > 2 * far["fragments"]
    assert rows(capsys, scene, "--views", "v.json")[0]["view"] == "view0"
    arguments = ["view", str(scene), "--views", "v.json", "--view", "view9", "--frames", "1", "--out", "o"]
    assert run(arguments) == ExitCode.NOT_FOUND
    assert "view0, view1" in capsys.readouterr().err


def test_a_model_is_fetched_from_a_service_and_kept_for_when_it_is_away(
    scene: Path, bundles: list[Path], server: ReleaseServer, capsys: pytest.CaptureFixture[str]
) -> None:
    publish(server, bundles[0], "1.0.0")
    asked = ["--budget", "0.6", "--layout", "single"]
    at = ["--model", "glass@champion", "--url", server.url, "--public-key", SIGNER.public_key]
    (fetched,) = rows(capsys, scene, *at, *asked)
    (local,) = rows(capsys, scene, "--bundle", str(bundles[0]), *asked)
    assert fetched["technique"] == "kbuffer-deep"
    assert (fetched["bundle"], local["bundle"]) == ("glass@1.0.0", str(bundles[0]))
    same = ("captured", "k_min", "k_max", "mse", "mse_display", "tail", "g")
    assert {name: fetched[name] for name in same} == {name: local[name] for name in same}
    server.stop()
    (again,) = rows(capsys, scene, *at, *asked)
    assert again["bundle"] == "glass@1.0.0"


def test_a_model_that_cannot_be_had_is_a_problem(
    scene: Path, bundles: list[Path], server: ReleaseServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    publish(server, bundles[0], "1.0.0")
    common = ["view", str(scene), "--frames", "1", "--out", "o", "--url", server.url, "--model"]
    assert run([*common, "mirror@champion"]) == ExitCode.NOT_FOUND
    assert run([*common, "glass", "--public-key", STRANGER.public_key]) == ExitCode.CHECK_FAILED
    monkeypatch.setenv("DIAPHANE_KEY", "dia_other")
    assert run([*common, "glass"]) == ExitCode.AUTH
    server.stop()
    assert run([*common, "glass"]) == ExitCode.TRY_AGAIN
    monkeypatch.setitem(sys.modules, "diaphane_client", None)
    assert run([*common, "glass"]) == ExitCode.CHECK_FAILED


def test_later_versions_of_the_alias_come_by_themselves(
    scene: Path, bundles: list[Path], server: ReleaseServer, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(model, "_EVERY", 0.02)
    publish(server, bundles[0], "1.0.0")
    with remote_source(Service("glass@champion", server.url, KEY, folder, follow=True)) as source:
        assert source.folder is not None
        assert source.name == "glass@1.0.0"
        assert source.newest() is None
        publish(server, bundles[1], "1.1.0")
        newer = source.later.get(timeout=30.0)
        assert newer.name == "1.1.0"
        assert source.newest() is None
        publish(server, bundles[0], "1.0.0")
        assert source.later.get(timeout=30.0).name == "1.0.0"
    local = LocalScene(scene, scene, LoadOptions())
    local.at(None)
    assert Studio(local.gpu(), Needs(), (1.0, 1.0, 1.0), 0.5).load(newer) == load_manifest(bundles[1]).tail


@pytest.mark.parametrize(
    ("arguments", "status", "said"),
    [
        (["--frames", "1"], ExitCode.USAGE, "--out"),
        (["--frames", "0", "--out", "o"], ExitCode.USAGE, "0 frames"),
        (["--layout", "cubist"], ExitCode.USAGE, "side-by-side"),
        (["--against", "magic"], ExitCode.NOT_FOUND, "magic"),
        (["-t", "kbuffer,moment"], ExitCode.USAGE, "One technique"),
        (["-t", "kbuffer-deep"], ExitCode.USAGE, "--model"),
        (["--model", "a@b", "--bundle", "c"], ExitCode.USAGE, "Both"),
        (["--watch", "--bundle", "c"], ExitCode.USAGE, "--watch"),
        (["--public-key", "AAAA", "--bundle", "c"], ExitCode.USAGE, "--model"),
        (["--camera", "a", "--view", "b"], ExitCode.USAGE, "Both"),
        (["--view", "nobody"], ExitCode.NOT_FOUND, "nobody"),
        (["--frames", "1", "--out", "o", "--csv", __file__], ExitCode.USAGE, "no file of statistics"),
    ],
)
def test_what_cannot_be_is_said_before_anything_is_done(
    scene: Path, folder: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], status: int, said: str
) -> None:
    assert run(["view", str(scene), *arguments]) == status
    assert said in capsys.readouterr().err
    assert not list(folder.iterdir())


def test_without_a_display_or_the_library_it_says_how_to_go_on(
    scene: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("DISPLAY", ":4294")
    assert run(["view", str(scene)]) == ExitCode.CHECK_FAILED
    assert "--frames 1 --out FOLDER" in capsys.readouterr().err
    monkeypatch.setitem(sys.modules, "pyglet", None)
    assert run(["view", str(scene)]) == ExitCode.CHECK_FAILED
    assert "pip install 'diaphane[view]'" in capsys.readouterr().err
