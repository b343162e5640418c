"""Commands on local scene files, as users call them: scene inspect, scene convert, render, dump."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import moderngl
import numpy as np
import OpenEXR
import pytest
from PIL import Image
from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade
from support.training import export_random, random_weights, real_features

from diaphane.cli.app import run
from evaluation.summary import said_unfit
from renderer import exact_bytes
from renderer.deep_exr import read_deep_exr
from renderer.dump import read_dump
from renderer.exr import read_exr
from renderer.frame import Frame
from renderer.techniques import TECHNIQUES, Budget, Needs, Rendered, Technique, bands
from schemas.colour import display8, linear_to_srgb, srgb_to_linear
from schemas.limits import LIMITS
from schemas.problem import ExitCode, Problem
from services.database import open_database
from services.registry import open_registry
from services.settings import Settings
from services.storage import open_storage

SHARED = Path(__file__).resolve().parents[3] / "shared" / "scenes"


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, gl: moderngl.Context) -> Path:
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("DIAPHANE_STATE", raising=False)
    write_panes(tmp_path / "panes.usda")
    return tmp_path


def write_panes(path: Path, panes: int = 6) -> None:
    """Panes of glass one behind the other, an opaque cube behind some of them, two cameras, one that moves."""
    stage = Usd.Stage.CreateNew(str(path))
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, "/World").GetPrim())
    UsdGeom.SetStageUpAxis(stage, "Y")
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    glass = UsdShade.Material.Define(stage, "/World/Glass")
    shader = UsdShade.Shader.Define(stage, "/World/Glass/Surface")
    shader.CreateIdAttr("UsdPreviewSurface")
    shader.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f).Set(Gf.Vec3f(0.9, 0.3, 0.1))
    shader.CreateInput("opacity", Sdf.ValueTypeNames.Float).Set(0.4)
    glass.CreateSurfaceOutput().ConnectToSource(shader.CreateOutput("surface", Sdf.ValueTypeNames.Token))
    for number in range(panes):
        pane = UsdGeom.Mesh.Define(stage, f"/World/Pane{number}")
        z = -0.3 * number
        pane.CreatePointsAttr([(-1, -1, z), (1 - 0.2 * number, -1, z), (1 - 0.2 * number, 1, z), (-1, 1, z)])
        pane.CreateFaceVertexCountsAttr([4])
        pane.CreateFaceVertexIndicesAttr([0, 1, 2, 3])
        if number % 2 == 0:
            UsdShade.MaterialBindingAPI.Apply(pane.GetPrim()).Bind(glass)
        else:
            pane.CreateDisplayColorAttr([Gf.Vec3f(0.1, 0.2 * number - 0.1, 0.9)])
            pane.CreateDisplayOpacityAttr([0.15 + 0.1 * number])
    solid = UsdGeom.Cube.Define(stage, "/World/Solid")
    solid.CreateSizeAttr(0.8)
    solid.AddTranslateOp().Set((0, 0, -2.5))
    solid.CreateDisplayColorAttr([Gf.Vec3f(0.1, 0.4, 0.8)])
    for name in ("front", "moving"):
        camera = UsdGeom.Camera.Define(stage, f"/World/{name}")
        camera.CreateHorizontalApertureAttr(30.0)
        camera.CreateVerticalApertureAttr(20.0)
        camera.CreateFocalLengthAttr(30.0)
        place = camera.AddTranslateOp()
        place.Set((0, 0, 4))
        if name == "moving":
            place.Set((0, 0, 4), 1.0)
            place.Set((0, 0, 6), 3.0)
    stage.Save()


def answer(capsys: pytest.CaptureFixture[str], *arguments: str) -> dict[str, Any]:
    assert run([*arguments, "--json"]) == ExitCode.OK
    found: dict[str, Any] = json.loads(capsys.readouterr().out)
    return found


def pixels(path: Path) -> np.ndarray:
    with Image.open(path) as image:
        return np.asarray(image)


def test_a_picture_is_as_high_as_the_camera_says(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["render", "panes.usda", "-w", "96"]) == ExitCode.OK
    out = capsys.readouterr().out
    assert "panes.png  sbuffer (exact)  96x64" in out
    assert "view front (first camera of the stage)" in out
    picture = pixels(folder / "panes.png")
    assert picture.shape == (64, 96, 3)
    assert picture[0, 0].tolist() == [255, 255, 255]
    assert picture[32, 30].tolist() != [255, 255, 255]


def test_every_technique_writes_a_file_of_its_own_and_says_what_it_cost(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    options = ["--technique", "all", "--budget", "0.5", "--compare", "-w", "48", "-o", "out/p.png"]
    pictures = answer(capsys, "render", "panes.usda", *options)["pictures"]
    by_name = {picture["technique"]: picture for picture in pictures}
    assert len(by_name) > 10
    exact = by_name["sbuffer"]
    for name, picture in by_name.items():
        assert picture["problem"] is None
        assert Path(picture["file"]) == Path(f"out/p-{name}.png")
        assert pixels(folder / picture["file"]).shape == (32, 48, 3)
        assert picture["fragments"] == exact["fragments"] > 0
        assert picture["total_ms"] == pytest.approx(sum(picture["passes"].values()))
        assert picture["total_bytes"] >= picture["pool_bytes"] + 48 * 32 * picture["pixel_bytes"]
        if picture["family"] == "exact":
            assert (picture["mse"], picture["flip"]) == (0.0, 0.0)
    assert by_name["kbuffer-optimal"]["captured"] <= 0.5 * 48 * 32
    assert 0.0 < by_name["kbuffer-optimal"]["mse"] <= by_name["kbuffer-importance"]["mse"]
    assert by_name["kbuffer"]["k"] == [0, 0]


def test_a_comparison_ends_with_one_ranking_and_a_contact_sheet(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    options = ["render", "panes.usda", "-t", "kbuffer,sbuffer,weighted-average", "--compare", "--budget", "0.5"]
    found = answer(capsys, *options, "-w", "48", "-o", "p.png")
    errors = {picture["technique"]: picture["mse"] for picture in found["pictures"]}
    ranks = [rank["technique"] for rank in found["ranking"]]
    assert ranks == sorted(errors, key=lambda name: errors[name])
    assert ranks[0] == "sbuffer"
    assert {picture["sheet"] for picture in found["pictures"]} == {"p-sheet.png"}
    height, width, _ = pixels(folder / "p-sheet.png").shape
    assert width >= 3 * 48
    assert height >= 2 * 32
    assert run([*options, "-w", "48", "-f", "1,2", "-cam", "moving", "-o", "q.#.png"]) == ExitCode.OK
    out = capsys.readouterr().out
    table = out[out.index("Ranked by error") :].splitlines()
    assert "means over 2 pictures" in table[0]
    assert [line.split()[0] for line in table[2:5]] == ["1", "2", "3"]
    assert "exact (sbuffer)" in table[2]
    assert table[5:] == ["Contact sheet: q-sheet.1.png", "Contact sheet: q-sheet.2.png"]


def test_what_is_timed_is_not_the_first_frame(
    folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn: list[tuple[int, int]] = []

    class Slow(TECHNIQUES["moment"]):  # type: ignore[misc]
        def render(self, frame: Frame, budget: Budget) -> Rendered:
            drawn.append((frame.width, frame.height))
            made = TECHNIQUES["sbuffer"].of(Needs()).render(frame, budget)
            return replace(made, passes={"first" if len(drawn) == 1 else "later": 1.0})

    monkeypatch.setitem(cast(dict[str, type[Technique]], TECHNIQUES), "moment", Slow)
    found = answer(capsys, "render", "panes.usda", "-t", "moment", "-w", "30", "--samples", "2")["pictures"]
    assert drawn == [(30, 20)] * 3
    assert found[0]["passes"] == {"later": 2.0}


def test_samples_are_resolved_in_linear_light(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Against the mean of 8x8 pixels of a larger picture, in linear light."""

    def rendered(technique: str, size: str, *options: str) -> tuple[dict[str, Any], np.ndarray]:
        common = ["--float", "--budget", "1", "--size", size, "-t", technique, "-o", "a.exr", "--background", "#000000"]
        (found,) = answer(capsys, "render", "panes.usda", *common, *options)["pictures"]
        return found, read_exr(folder / "a.exr").astype(np.float64)

    fine = rendered("sbuffer", "424x344")[1].reshape(43, 8, 53, 8, 3)
    exact, in_srgb = fine.mean(axis=(1, 3)), srgb_to_linear(linear_to_srgb(fine).mean(axis=(1, 3)))
    for technique in ("sbuffer", "kbuffer"):
        single, jagged = rendered(technique, "53x43")
        found, smooth = rendered(technique, "53x43", "--samples", "16")
        assert found["samples"] == 16
        assert found["budget"] == 16 * single["budget"] == 16 * 53 * 43
        assert found["total_bytes"] == pytest.approx(single["total_bytes"], rel=0.1)
        assert found["fragments"] == pytest.approx(16 * single["fragments"], rel=0.05)
        edges = np.abs(in_srgb - exact).max(axis=2) > 0.02
        assert edges.sum() > 30
        errors = [np.abs(each - exact)[edges].mean() for each in (smooth, jagged, in_srgb)]
        assert errors[0] < 0.1 * min(errors[1:])


def test_layers_of_an_exr_are_read_by_others(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The layers of `--aov` against the deep picture of the same view, by OpenEXR's own reader."""
    layers = ["--aov", "depth,n", "--aov", "k,alpha"]
    (found,) = answer(capsys, "render", "panes.usda", "-w", "60", *layers, "-o", "a.exr")["pictures"]
    answer(capsys, "dump", "panes.usda", "-o", "deep.exr", "-w", "60")
    with OpenEXR.File("a.exr", separate_channels=True) as file:
        planes = {name: channel.pixels for name, channel in file.channels().items()}
    with OpenEXR.File("deep.exr", separate_channels=True) as file:
        deep = {name: channel.pixels for name, channel in file.channels().items()}
    assert set(planes) == {"R", "G", "B", "depth.Z", "n.V", "k.V", "alpha.A"}
    assert {planes[name].dtype for name in ("depth.Z", "n.V", "k.V", "alpha.A")} == {np.dtype(np.float32)}
    assert planes["n.V"].sum() == found["fragments"] > 0
    assert np.array_equal(planes["k.V"], planes["n.V"])
    has_opaque = np.zeros(planes["n.V"].shape, dtype=bool)
    for y, x in np.ndindex(planes["n.V"].shape):
        samples = deep["A"][y, x]
        if samples is None or len(samples) == 0:
            assert (planes["alpha.A"][y, x], planes["depth.Z"][y, x]) == (0.0, np.inf)
            continue
        alphas = np.asarray(samples, dtype=np.float64)
        has_opaque[y, x] = alphas[-1] == 1.0
        assert planes["n.V"][y, x] == len(alphas) - has_opaque[y, x]
        assert planes["alpha.A"][y, x] == pytest.approx(1.0 - np.prod(1.0 - alphas), abs=2e-3)  # half floats
        assert planes["depth.Z"][y, x] == pytest.approx(deep["Z"][y, x][0], rel=1e-6)
    assert 0 < has_opaque.sum() < has_opaque.size
    (found,) = answer(capsys, "render", "panes.usda", "-w", "60", *layers, "--samples", "4", "-o", "b.exr")["pictures"]
    with OpenEXR.File("b.exr", separate_channels=True) as file:
        soft = file.channels()["alpha.A"].pixels
        assert 4.0 * file.channels()["n.V"].pixels.sum() == pytest.approx(found["fragments"])
    assert len(np.unique(soft)) > len(np.unique(planes["alpha.A"]))
    assert run(["render", "panes.usda", "-w", "60", *layers, "-o", "a.png"]) == ExitCode.USAGE
    assert "Name an EXR picture" in capsys.readouterr().err


def test_a_scene_without_anything_transparent_is_said_to_have_none(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    stage = Usd.Stage.CreateNew("solid.usda")
    UsdGeom.Cube.Define(stage, "/Cube")
    stage.Save()
    assert run(["render", "solid.usda", "-w", "16"]) == ExitCode.OK
    assert "nothing in it is transparent: --alpha 0.33 makes every surface so" in capsys.readouterr().err
    assert run(["render", "solid.usda", "-w", "16", "--alpha", "0.33"]) == ExitCode.OK
    assert run(["render", "panes.usda", "-w", "16"]) == ExitCode.OK
    assert "nothing in it" not in capsys.readouterr().err


def test_a_folder_that_is_made_on_the_way_is_said(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for command, name, is_said in (
        ("render", "new/deep/a.png", True),
        ("render", "new/deep/b.png", False),
        ("render", "c.png", False),
        ("dump", "new/dumps/d.exr", True),
    ):
        assert run([command, "panes.usda", "-w", "16", "-o", name]) == ExitCode.OK
        told = f"the folder {Path(name).parent} does not exist; it will be made" in capsys.readouterr().err
        assert told is is_said
        assert (folder / name).is_file()


def test_an_exact_technique_that_cannot_render_a_view_says_what_it_would_need(
    folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(bands, "MOST_FRAGMENTS", 0)
    monkeypatch.setattr(exact_bytes, "LIMITS", replace(LIMITS, buffer_bytes=1000))
    options = ["render", "panes.usda", "-t", "all", "-w", "48"]
    found = {picture["technique"]: picture for picture in answer(capsys, *options)["pictures"]}
    arrays, exact = found["abuffer-array"], found["sbuffer"]
    assert arrays["problem"].startswith("A pixel has")
    assert arrays["fragments"] == exact["fragments"] > 0
    assert arrays["pool_bytes"] >= 8 * exact["fragments"]
    assert arrays["total_bytes"] == arrays["pool_bytes"] + 48 * 32 * arrays["pixel_bytes"]
    assert not (folder / arrays["file"]).exists()
    assert (folder / exact["file"]).exists()
    assert [found[name]["fits"] for name in ("abuffer-array", "sbuffer", "weighted-average")] == [False, False, True]
    assert run(options) == ExitCode.OK
    out = capsys.readouterr().out
    assert "it would need pool" in out
    assert said_unfit() in out


def test_what_exceeds_the_limits_is_left_out_among_others_and_a_problem_alone(
    folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    class TooLarge(TECHNIQUES["moment"]):  # type: ignore[misc]
        def render(self, frame: Frame, budget: Budget) -> Rendered:
            raise Problem("It needs 9 GiB.", "Ask for less.", ExitCode.LIMIT)

    monkeypatch.setitem(cast(dict[str, type[Technique]], TECHNIQUES), "moment", TooLarge)
    found = answer(capsys, "render", "panes.usda", "-t", "moment,sbuffer", "-w", "30")["pictures"]
    assert [picture["problem"] for picture in found] == ["It needs 9 GiB.", None]
    assert sorted(path.name for path in folder.glob("*.png")) == ["panes-sbuffer.png"]
    assert run(["render", "panes.usda", "-t", "moment,sbuffer", "-w", "30"]) == ExitCode.OK
    assert "left out: It needs 9 GiB." in capsys.readouterr().out
    assert run(["render", "panes.usda", "-t", "moment", "-w", "30"]) == ExitCode.LIMIT
    capsys.readouterr()


def test_frames_are_numbered_and_follow_the_camera(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    options = ["-cam", "moving", "--frames", "1:3x2", "-w", "48", "-o", "shot.###.png"]
    found = answer(capsys, "render", "panes.usda", *options)["pictures"]
    assert [picture["frame"] for picture in found] == [1.0, 3.0]
    near, far = (pixels(folder / f"shot.{number}.png") for number in ("001", "003"))
    assert (near != 255).any(axis=2).sum() > 1.5 * (far != 255).any(axis=2).sum()
    assert run(["render", "panes.usda", "-f", "1:3", "-o", "all.png"]) == ExitCode.USAGE
    assert answer(capsys, "render", "panes.usda", "-d", "-w", "48")["pictures"][0]["frame"] is None


def test_an_exr_holds_the_same_picture_and_how_it_was_made(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for suffix in ("png", "exr"):
        options = ["-t", "kbuffer", "--budget", "1", "--tail", "paper", "--size", "50x40", "-o", f"a.{suffix}"]
        assert run(["render", "panes.usda", *options]) == ExitCode.OK
    step = display8(read_exr(folder / "a.exr")).astype(int) - pixels(folder / "a.png")
    assert np.abs(step).max() <= 1
    with OpenEXR.File("a.exr", header_only=True) as file:
        header = dict(file.header())
    assert (header["technique"], header["tail"], header["budget"]) == ("kbuffer", "paper", "2000")
    assert "opaque" in header["milliseconds"]
    assert header["worldToNDC"].shape == (4, 4)


def test_several_scenes_and_listed_views_do_not_overwrite_each_other(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_panes(folder / "more.usda", 2)
    view = {"eye": [0, 0, 5], "target": [0, 0, 0], "up": [0, 1, 0], "fov": 40}
    scenes = [{"main": name, "views": [view] * 2} for name in ("panes.usda", "more.usda")]
    (folder / "views.json").write_text(json.dumps({"scenes": scenes}))
    options = ["--views", "views.json", "-w", "30", "-o", "x.png"]
    found = answer(capsys, "render", "panes.usda", "more.usda", *options)["pictures"]
    expected = ["x-panes-view0.png", "x-panes-view1.png", "x-more-view0.png", "x-more-view1.png"]
    assert [picture["file"] for picture in found] == expected
    assert run(["render", "panes.usda", "panes.usda", "-w", "30"]) == ExitCode.USAGE
    assert "More than one picture" in capsys.readouterr().err


def test_a_bundle_is_a_folder_or_a_name_in_the_registry(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    made = folder / "bundle"
    made.mkdir()
    export_random(made, random_weights(3), real_features(64, 5))
    settings = Settings(state=folder / ".diaphane", database="", store="", cache="")
    database = open_database(settings.database_url)
    registry = open_registry(database, open_storage(settings).blobs, settings)
    registry.consider(registry.publish("glass", made, 1.0, {}), 1.0, None)
    database.close()
    files = []
    for name in (str(made), "glass@champion", "glass"):
        options = ["-t", "kbuffer-deep", "--bundle", name, "--budget", "0.6", "-w", "48", "-o", f"b{len(files)}.png"]
        (picture,) = answer(capsys, "render", "panes.usda", *options)["pictures"]
        assert picture["captured"] == min(picture["budget"], picture["fragments"])
        files.append(pixels(folder / picture["file"]))
    assert np.array_equal(files[0], files[1])
    assert np.array_equal(files[0], files[2])
    assert run(["render", "panes.usda", "-t", "kbuffer-deep", "--bundle", "mirror"]) == ExitCode.NOT_FOUND


def test_opacity_background_and_vkb_reach_the_picture(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    common = ["panes.usda", "-w", "30"]
    assert run(["render", *common, "--alpha", "1", "--background", "#102030", "-o", "solid.png"]) == ExitCode.OK
    assert pixels(folder / "solid.png")[0, 0].tolist() == [16, 32, 48]
    vkb = ["-t", "kbuffer-importance", "--budget", "0.3", "--tail", "weighted-average", "--json"]
    pictures = []
    for switch in ("", "no-noise", "no-noise,no-periphery"):
        assert run(["render", *common, *vkb, "--vkb", switch, "-o", f"v{len(pictures)}.png"]) == ExitCode.OK
        pictures.append(pixels(folder / f"v{len(pictures)}.png"))
    assert not np.array_equal(pictures[0], pictures[1])
    assert not np.array_equal(pictures[1], pictures[2])
    capsys.readouterr()


def test_a_dump_is_the_same_as_zarr_and_as_deep_exr(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    found = answer(capsys, "dump", "panes.usda", "-o", "d", "--exr", "-w", "60")
    assert [Path(entry["path"]).name for entry in found["written"]] == ["fragments.zarr", "fragments.exr"]
    assert found["most"] == 6
    dump, deep = read_dump(folder / "d"), read_deep_exr(folder / "d" / "fragments.exr")
    assert dump.total == found["fragments"] > 0
    for name in ("offsets", "rgba", "depth", "background"):
        assert np.array_equal(getattr(dump, name), getattr(deep, name)), name
    again = answer(capsys, "dump", "d/fragments.exr", "-o", "back")
    assert again["fragments"] == found["fragments"]
    assert np.array_equal(read_dump(folder / "back").rgba, dump.rgba)
    assert run(["dump", "panes.usda", "-o", "alone.exr", "-w", "60"]) == ExitCode.OK
    assert (folder / "alone.exr").stat().st_size == found["written"][1]["bytes"]
    assert "at most 6" in capsys.readouterr().out


def test_the_opaque_sample_has_the_depth_of_the_cube(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["dump", "panes.usda", "-o", "a.exr", "--size", "31x31"]) == ExitCode.OK
    with OpenEXR.File("a.exr", separate_channels=True) as file:
        channels = {name: channel.pixels for name, channel in file.channels().items()}
    centre = {name: channels[name][15, 15] for name in "AZ"}
    # The camera stands at z = 4, the cube's face at -2.1, the last pane that reaches the middle at -1.2.
    assert centre["A"][-1] == 1.0
    assert centre["Z"][-1] == pytest.approx(6.1, abs=1e-4)
    assert centre["Z"][0] == pytest.approx(4.0, abs=1e-4)
    assert channels["Z"][0, 0] is None or len(channels["Z"][0, 0]) == 0
    capsys.readouterr()


def test_inspect_prints_what_was_found(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["scene", "inspect", "panes.usda"]) == ExitCode.OK
    out = capsys.readouterr().out
    assert "12 transparent" in out
    assert "12 opaque" in out
    assert "/World/Glass" in out
    assert "opacity 0.4" in out
    assert "camera /World/moving: perspective" in out
    report = answer(capsys, "scene", "inspect", "panes.usda", "--alpha", "0.5")
    assert report["triangles"] == {"transparent": 24}
    assert report["file"] == "panes.usda"


def test_glass_is_drawn_and_what_a_picture_lacks_is_said(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    stage = Usd.Stage.Open("panes.usda")
    stage.GetPrimAtPath("/World/Glass/Surface").GetAttribute("inputs:opacity").Set(0.0)
    stage.DefinePrim("/World/Sun", "DistantLight")
    stage.Save()
    (glass,) = answer(capsys, "render", "panes.usda", "-w", "40", "-o", "glass.png")["pictures"]
    (plain,) = answer(capsys, "render", "panes.usda", "-w", "40", "-o", "plain.png", "--glass", "plain")["pictures"]
    assert glass["fragments"] > plain["fragments"] > 0
    told = "warning: panes.usda: lights are not used, every scene is lit alike: /World/Sun"
    lost = "warning: panes.usda: its opacity is 0, nothing of it is drawn: /World/Pane0 (and 2 more)"
    bench = ["bench", "panes.usda", "-t", "kbuffer", "--budgets", "1", "--size", "48x32", "--repeats", "1"]
    bench += ["--equal-fragments", "--no-account", "-o", "out"]
    for command in (["render", "panes.usda", "-w", "40"], bench, ["dump", "panes.usda", "-o", "d", "-w", "40"]):
        assert run(command) == ExitCode.OK
        assert capsys.readouterr().err.count(told) == 1
    assert run(["render", "panes.usda", "-w", "40", "--glass", "plain"]) == ExitCode.OK
    assert lost in capsys.readouterr().err
    assert run(["scene", "inspect", "panes.usda"]) == ExitCode.OK
    assert "glass: opacity 0, ior 1.5, drawn with Fresnel alpha .04 to 1" in capsys.readouterr().out
    assert run(["render", "panes.usda", "--glass", "thick"]) == ExitCode.USAGE
    assert "fresnel, plain" in capsys.readouterr().err


def test_inspect_reports_a_scene_without_geometry_and_ends_with_the_problem(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    stage = Usd.Stage.CreateNew(str(folder / "empty.usda"))
    UsdGeom.Camera.Define(stage, "/Shot")
    stage.Save()
    assert run(["scene", "inspect", "empty.usda"]) == ExitCode.USAGE
    captured = capsys.readouterr()
    assert "camera /Shot" in captured.out
    assert "no geometry" in captured.err


def test_a_model_is_converted_inspected_and_rendered(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "m.mtl").write_text("newmtl glass\nKd 0.2 0.4 0.9\nd 0.5\n")
    (folder / "m.obj").write_text("mtllib m.mtl\nusemtl glass\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    found = answer(capsys, "scene", "convert", "m.obj", "m.usdz", "--metersPerUnit", "0.01")
    assert (found["triangles"], found["materials"], found["metres_per_unit"]) == (1, 1, 0.01)
    assert answer(capsys, "scene", "inspect", "m.usdz")["triangles"] == {"transparent": 1}
    assert run(["render", "m.usdz", "-w", "40", "-o", "a.png"]) == ExitCode.OK
    assert run(["render", "m.obj", "-w", "40", "-o", "b.png"]) == ExitCode.OK
    assert np.array_equal(pixels(folder / "a.png"), pixels(folder / "b.png"))
    assert run(["scene", "convert", "m.mtl", "x.usda"]) == ExitCode.USAGE
    capsys.readouterr()


@pytest.mark.parametrize(
    ("arguments", "status"),
    [
        (["render", "missing.usda"], ExitCode.NOT_FOUND),
        (["render", "panes.usda", "-cam", "nowhere"], ExitCode.NOT_FOUND),
        (["render", "panes.usda", "-t", "kbuffer-deep"], ExitCode.USAGE),
        (["render", "panes.usda", "--size", "20000x20000"], ExitCode.USAGE),
        (["render", "panes.usda", "--budget", "1e-9"], ExitCode.USAGE),
        (["render", "panes.usda", "--samples", "3"], ExitCode.USAGE),
        (["render", "panes.usda", "-o", "a.exr", "--aov", "z"], ExitCode.USAGE),
        (["render", "panes.usda", "--bundle", "/no/such/folder"], ExitCode.NOT_FOUND),
        (["render", "panes.usda", "--bundle", "panes.usda"], ExitCode.USAGE),
        (["render", "panes.usda", "-t", "multilayer", "--nodes", "0"], ExitCode.USAGE),
        (["dump", "panes.usda"], ExitCode.USAGE),
        (["dump", "missing.exr", "-o", "d"], ExitCode.NOT_FOUND),
        (["scene", "inspect", "missing.usda"], ExitCode.NOT_FOUND),
        (["scene", "convert", "missing.obj", "a.usda"], ExitCode.NOT_FOUND),
    ],
)
def test_mistakes_end_with_what_to_do(
    arguments: list[str], status: ExitCode, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(arguments) == status
    captured = capsys.readouterr()
    assert captured.err.startswith("error: ")
    assert "Traceback" not in captured.err


def test_files_here_and_scenes_there_name_each_other(capsys: pytest.CaptureFixture[str]) -> None:
    for command, other in (("scene", "diaphane scenes"), ("scenes", "diaphane scene")):
        run([command, "--help"])
        words = " ".join(capsys.readouterr().out.replace("│", " ").split())
        assert other in words


@pytest.mark.skipif(not SHARED.is_dir(), reason="the shared scenes are not here")
@pytest.mark.parametrize("name", ["alpha_blend_sort_test", "glass_vase_flowers", "mcusd"])
def test_real_scenes_are_inspected_and_rendered(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    manifest = json.loads((SHARED / "MANIFEST.json").read_text(encoding="utf-8"))
    (entry,) = (scene for scene in manifest["scenes"] if scene["name"] == name)
    file = str(SHARED / entry["main"])
    report = answer(capsys, "scene", "inspect", file)
    assert sum(report["triangles"].values()) == entry["triangles"]
    assert report["up_axis"] == entry["upAxis"]
    (picture,) = answer(capsys, "render", file, "-w", "64", "-o", "a.png")["pictures"]
    assert picture["fragments"] > 0
    assert len(np.unique(pixels(Path("a.png")).reshape(-1, 3), axis=0)) > 20


def test_frames_of_a_sequence_without_anything_to_draw_are_left_out(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    stage = Usd.Stage.CreateNew("blinks.usda")
    cube = UsdGeom.Cube.Define(stage, "/Cube")
    for time, token in ((1, "invisible"), (2, "inherited"), (3, "invisible")):
        cube.CreateVisibilityAttr().Set(token, time)
    stage.GetRootLayer().Save()
    assert run(["render", "blinks.usda", "-w", "16", "-f", "1:3", "-o", "b.#.png"]) == ExitCode.OK
    assert sorted(path.name for path in folder.glob("b.*.png")) == ["b.2.png"]
    assert "frame 3 is left out" in capsys.readouterr().err
    assert run(["render", "blinks.usda", "-w", "16", "-f", "1,3", "-o", "c.#.png"]) == ExitCode.USAGE


def test_where_no_picture_can_be_written_the_output_is_named(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "file").touch()
    for name in ("a.png", "a.exr"):
        assert run(["render", "panes.usda", "-w", "16", "-o", f"file/{name}"]) == ExitCode.TRY_AGAIN
        said = capsys.readouterr().err
        assert f"file/{name} cannot be written" in said
        assert "name another place" in said
