"""The browser client as the service serves it: its pictures beside the renderer's, its page, its registry."""

from __future__ import annotations

import io
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import moderngl
import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray
from PIL import Image
from support.api import Api
from support.browser import Tab
from support.dashboard import Visitor
from support.training import random_weights

from renderer.capture import capture
from renderer.convert import stage_file
from renderer.features import derive, gather
from renderer.frame import Frame
from renderer.gpu_scene import GpuScene
from renderer.samples.glb import HOME
from renderer.scene import load_scene
from renderer.techniques import Binned, Budget, KBuffer, KBufferDeep, SBuffer, Technique, WeightedBlended
from renderer.views import framing_view
from schemas.bundle import HeadName, ParityReport, Provenance, TailSpec
from schemas.colour import display8
from schemas.tail import BINNED_TAILS, DEFAULT_TAIL, TailName
from services.dashboard import SESSION_ANSWERS, demo
from services.dashboard.page import POLICY
from trainer.bundle import Description, write_bundle

SIZE = (480, 320)
PIXELS = SIZE[0] * SIZE[1]
MOST_BIN = 64
"""Fragments that a bin of a pixel may have: what a budget may be left with."""
SAME_K, SAME_COLOUR = 0.96, 0.997
"""Shares of pixels with the renderer's k, and its colour, where bins are chosen. At the resolution that ranges of tiles
are found at, rasterisers decide some silhouettes otherwise: then the bins of 64 pixels lie elsewhere."""
GLB = HOME / "shells.glb"
SIZED = """window.addEventListener('DOMContentLoaded', () => {
    const style = { boxSizing: 'content-box', width: '480px', height: '320px', aspectRatio: 'auto' };
    Object.assign(document.getElementById('stage')?.style ?? {}, style);
})"""
OTHER_TAILS = tuple(tail for tail in BINNED_TAILS if tail != DEFAULT_TAIL)
AUDIT = Path(__file__).with_name("dashboard_audit.js").read_text(encoding="utf-8").rstrip("\n;")


@pytest.fixture(scope="module")
def frame(gl: moderngl.Context, tmp_path_factory: pytest.TempPathFactory) -> Frame:
    scene = load_scene(stage_file(GLB.parent, GLB.name, tmp_path_factory.mktemp("glb")))
    return Frame(GpuScene(gl, scene), framing_view(scene), *SIZE)


@pytest.fixture(scope="module")
def bundles(frame: Frame, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """A bundle for every tail, that for the default tail `glass`; and one of importances."""
    provenance = Provenance(scenes={}, code_version="0", seed=0, machine="test")
    parity = ParityReport(count=1, tolerance=1e-5, torch_onnx=0.0, torch_glsl=0.0, torch_ubo=0.0, driver="none")
    dump = capture(frame).dump
    names: dict[str, tuple[TailName, HeadName]] = {
        **{tail: (tail, "bin-gains") for tail in OTHER_TAILS},
        "glass": (DEFAULT_TAIL, "bin-gains"),
        "importance": (DEFAULT_TAIL, "importance"),
    }
    made = {}
    for name, (tail, head) in names.items():
        made[name] = tmp_path_factory.mktemp("bundles") / name
        described = Description(name, TailSpec(name=tail, g=0.75), "display", provenance, {})
        weights = random_weights(11, head=head, tail=tail)
        write_bundle(made[name], weights, described, derive(gather(dump, tail)), lambda: parity)
    return made


@pytest.fixture(scope="module")
def api(bundles: dict[str, Path], tmp_path_factory: pytest.TempPathFactory) -> Api:
    made = Api(tmp_path_factory.mktemp("service"), rate=1e6, burst=10**6)
    for name, folder in bundles.items():
        made.service.registry.publish(name, folder, 0.5, {"views": 2})
    made.service.registry.promote("glass", "1.0.0", "It is first.", who="key_000000000000")
    return made


@pytest.fixture(scope="module")
def tab(webgpu: Any, api: Api, url: str) -> Iterator[Tab]:
    """Signed in, with the model loaded, at the size of the frame."""
    opened = Tab(webgpu, url, 1280, "light")
    opened.page.add_init_script(SIZED)
    opened.sign_in(api.secrets["read"], "/models")
    opened.page.goto("/demo")
    opened.page.locator("#model-note").get_by_text("self-test passes").wait_for()
    size = opened.page.evaluate("[canvas.clientWidth, canvas.clientHeight]")
    assert size == list(SIZE)
    yield opened
    opened.context.close()


def _pictured(
    tab: Tab, frame: Frame, technique: str, factor: float
) -> tuple[NDArray[np.uint8], NDArray[np.int64], int]:
    """sRGB [H, W, 3] and slots [P] of the page's picture, and N of the view."""
    view = {name: getattr(frame.view, name) for name in ("eye", "target", "up", "fov")}
    found = tab.page.evaluate(
        """async ([view, technique, factor]) => {
            const { words, offsets, fragments } = await diaphane.picture(view, technique, factor);
            return [Array.from(words), Array.from(offsets), fragments];
        }""",
        [view, technique, factor],
    )
    words, offsets = (np.array(numbers, dtype=np.uint32) for numbers in found[:2])
    rgb = np.stack([words & 255, words >> 8 & 255, words >> 16 & 255], axis=-1)
    return rgb.astype(np.uint8).reshape(SIZE[1], SIZE[0], 3), np.diff(offsets.astype(np.int64)), found[2]


def _shares(picture: NDArray[np.uint8], linear: NDArray[np.float32]) -> float:
    """Share of the pixels that agree within 2 of 255."""
    apart = np.abs(picture.astype(int) - display8(linear).astype(int)).max(axis=2)
    return float(np.mean(apart <= 2))


@pytest.mark.parametrize(
    ("technique", "factor"),
    [(SBuffer(), 1.0), (WeightedBlended(), 1.0), (Binned(), 1.0), (KBuffer(), 2.0)],
    ids=["sbuffer", "weighted-blended", "binned", "kbuffer"],
)
def test_pictures_are_the_renderers(tab: Tab, frame: Frame, technique: Technique, factor: float) -> None:
    picture, _, _ = _pictured(tab, frame, technique.name, factor)
    expected = technique.render(frame, Budget(int(factor * PIXELS)))
    assert _shares(picture, expected.linear) >= 0.999
    assert tab.faults == []


def test_half_floats_do_where_float32_is_not_blended(webgpu: Any, api: Api, url: str, frame: Frame) -> None:
    opened = Tab(webgpu, url, 1280, "light")
    opened.page.add_init_script(SIZED)
    opened.page.add_init_script(
        """const { has } = GPUSupportedFeatures.prototype;
        GPUSupportedFeatures.prototype.has = function (name) {
            return name !== 'float32-blendable' && has.call(this, name);
        };"""
    )
    opened.page.goto("/demo")
    opened.page.locator("#figures tr").nth(1).wait_for()
    # Bins lie otherwise in a few tiles, and half floats round beside it: 99.898 % of the fixed k's pixels are the same.
    for technique, share in ((Binned(), 0.998), (KBuffer(), 0.998), (WeightedBlended(), 0.999)):
        picture, _, _ = _pictured(opened, frame, technique.name, 1.0)
        assert _shares(picture, technique.render(frame, Budget(PIXELS)).linear) >= share
    assert opened.faults == []
    opened.context.close()


@pytest.mark.parametrize(("model", "factors"), [("glass@champion", (0.1, 0.5, 4.0)), ("importance@1.0.0", (0.5,))])
def test_predicted_cores_stay_within_the_budget(
    tab: Tab, frame: Frame, bundles: dict[str, Path], model: str, factors: tuple[float, ...]
) -> None:
    """From less than a slot for every occupied pixel to more than there are fragments."""
    _choose(tab, model)
    deep = KBufferDeep(bundles[model.split("@")[0]])
    for factor in factors:
        picture, k, total = _pictured(tab, frame, "kbuffer-deep", factor)
        expected = deep.render(frame, Budget(int(factor * PIXELS), tail=DEFAULT_TAIL))
        budget = min(int(factor * PIXELS), total)
        assert expected.k.sum() - MOST_BIN <= k.sum() <= budget
        assert np.mean(k == expected.k) > SAME_K
        assert _shares(picture, expected.linear) >= SAME_COLOUR
    _choose(tab, "glass@champion")
    assert tab.faults == []


def _choose(tab: Tab, model: str) -> None:
    tab.page.locator("#model").select_option(model)
    tab.page.locator("#model-note").get_by_text(f"{model.split('@')[0]} 1.0.0: ").wait_for()


def test_the_last_model_draws_while_another_one_is_fetched(tab: Tab) -> None:
    page = tab.page
    held: list[Any] = []
    page.route("**/demo/v1/blobs/**", lambda route: held.append(route))
    page.locator("#model").select_option("importance@1.0.0")
    page.get_by_label("Budget").fill("-1")
    page.locator("#figures tr").nth(1).get_by_text(f"{PIXELS // 2:,}").wait_for()
    assert len(held) == 1
    assert page.get_by_role("alert").count() == 0
    page.unroute("**/demo/v1/blobs/**")
    page.locator("#model-note").get_by_text("importance 1.0.0: ").wait_for()
    page.get_by_label("Budget").fill("-2")
    _choose(tab, "glass@champion")
    assert tab.faults == []


@pytest.mark.parametrize("tail", OTHER_TAILS)
def test_every_tail_of_a_bundle_is_rendered(tab: Tab, frame: Frame, bundles: dict[str, Path], tail: TailName) -> None:
    _choose(tab, f"{tail}@1.0.0")
    picture, k, _ = _pictured(tab, frame, "kbuffer-deep", 0.5)
    deep = KBufferDeep(bundles[tail])
    expected = deep.render(frame, Budget(PIXELS // 2, tail=tail))
    assert expected.k.sum() - MOST_BIN <= k.sum() <= PIXELS // 2
    assert np.mean(k == expected.k) > SAME_K
    assert _shares(picture, expected.linear) >= SAME_COLOUR
    default = KBufferDeep(bundles["glass"]).render(frame, Budget(PIXELS // 2, tail=DEFAULT_TAIL))
    assert np.mean(k == default.k) < np.mean(k == expected.k) - 0.03
    _choose(tab, "glass@champion")
    assert tab.faults == []


def test_errors_are_measured_against_the_exact_picture(tab: Tab) -> None:
    page = tab.page
    page.get_by_label("Right").select_option("sbuffer")
    page.locator("#figures tr").nth(1).get_by_text("exact", exact=True).wait_for()
    left = page.locator("#figures tr").nth(0).locator("td")
    assert 0.0 < float(left.nth(0).inner_text()) < 1000.0
    assert 20.0 < float(left.nth(1).inner_text()) < 90.0
    page.get_by_label("Right").select_option("kbuffer-deep")
    page.get_by_label("Shown").select_option("count")
    page.locator("#figures tr").nth(1).get_by_text("kbuffer-deep").wait_for()
    assert page.locator("#legend").is_visible()
    page.get_by_label("Shown").select_option("picture")
    assert tab.faults == []


def test_the_keyboard_turns_and_splits(tab: Tab) -> None:
    page = tab.page
    page.locator("#stage").focus()
    page.keyboard.press("]")
    assert page.get_by_label("Split").input_value() == "55"
    before = page.locator("#facts").inner_text()
    page.keyboard.press("ArrowUp")
    page.keyboard.press("+")
    page.wait_for_timeout(100)
    page.locator("#facts").filter(has_not_text=before).wait_for()
    page.keyboard.press("0")
    # The split moves also while a picture is being drawn, which needs something read back.
    page.evaluate(
        """() => {
            const { mapAsync } = GPUBuffer.prototype;
            const released = new Promise((done) => (globalThis.release = done));
            GPUBuffer.prototype.mapAsync = async function (...all) {
                globalThis.isHeld = true;
                await released;
                return mapAsync.apply(this, all);
            };
        }"""
    )
    page.keyboard.press("ArrowLeft")
    tab.until("!!globalThis.isHeld")
    page.keyboard.press("[")
    shown = np.asarray(Image.open(io.BytesIO(page.locator("#canvas").screenshot())).convert("L"), dtype=int)
    assert np.flatnonzero(np.abs(shown[3] - 128) <= 2).tolist() == [SIZE[0] // 2 - 1, SIZE[0] // 2]
    page.evaluate("release()")
    page.keyboard.press("0")
    assert tab.faults == []


def test_files_are_opened_or_refused_with_a_remedy(tab: Tab, tmp_path: Path) -> None:
    page = tab.page
    damaged = tmp_path / "damaged.glb"
    damaged.write_bytes(GLB.read_bytes()[:500])
    page.get_by_label("A file of your own").set_input_files(damaged)
    page.get_by_role("alert").get_by_text("damaged.glb cannot be read").wait_for()
    page.get_by_label("A file of your own").set_input_files(HOME / "shelf.glb")
    page.get_by_role("alert").wait_for(state="hidden")
    assert page.get_by_label("Scene").locator("option").nth(0).inner_text() == "shelf.glb"
    page.locator("#scene").select_option("glass shells")
    page.locator("#status:empty").wait_for(state="attached")
    page.locator("#scene").select_option(label="shelf.glb")
    page.locator("#status:empty").wait_for(state="attached")
    assert page.get_by_role("alert").count() == 0
    with page.expect_file_chooser():
        page.get_by_label("A file of your own").click()
    assert page.get_by_label("A file of your own").input_value() == ""  # so that the same file is another choice
    assert tab.faults == []


def _refused(tab: Tab, path: Path, text: str) -> None:
    tab.page.get_by_label("A file of your own").set_input_files(path)
    tab.page.get_by_role("alert").get_by_text(text).wait_for()


def _stack(path: Path, layers: int, aside: float = 0.0) -> Path:
    """Squares of very thin black glass in one place; small ones where crumbs lie `aside`, for the camera to include."""
    corners = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], dtype=float)
    faces = np.tile([[0, 1, 2], [0, 2, 3]], (layers, 1))
    if aside:
        crumbs = [(side * aside, 0.01 * x, 0.01 * y) for side in (-1, 1) for x, y in ((0, 0), (1, 0), (0, 1))]
        corners = np.concatenate([corners, crumbs])
        faces = np.concatenate([faces, [[4, 5, 6], [7, 8, 9]]])
    glass = trimesh.visual.material.PBRMaterial(baseColorFactor=[0, 0, 0, 1], alphaMode="BLEND")
    look = trimesh.visual.TextureVisuals(uv=np.zeros((len(corners), 2)), material=glass)
    mesh = trimesh.Trimesh(corners, faces, vertex_normals=np.tile([0.0, 0, 1], (len(corners), 1)), process=False)
    mesh.visual = look
    path.write_bytes(trimesh.exchange.gltf.export_glb(mesh, include_normals=True))
    return path


def test_what_would_keep_the_device_busy_is_refused_at_once(tab: Tab, tmp_path: Path) -> None:
    page = tab.page
    _refused(tab, _stack(tmp_path / "glass.glb", 70_000), "The surfaces cover the picture")
    page.locator("#status:empty").wait_for(state="attached")
    _refused(tab, _stack(tmp_path / "pile.glb", 5_000, aside=30.0), "A pixel has 5,000 transparent fragments")
    page.locator("#scene").select_option("glass shells")
    page.get_by_role("alert").wait_for(state="hidden")
    page.locator("#figures tr").nth(1).wait_for()
    assert tab.faults == []


def test_what_takes_long_is_drawn_in_runs_and_whole(tab: Tab, tmp_path: Path) -> None:
    """Two runs of triangles in each pass: no fragment is missing, and none is there twice."""
    page = tab.page
    layers = 120
    page.get_by_label("A file of your own").set_input_files(_stack(tmp_path / "layers.glb", layers))
    page.locator("#facts").get_by_text(f" {layers}.0 each").wait_for()
    words, fragments = page.evaluate(
        """async (view) => {
            const { words, fragments } = await diaphane.picture(view, 'weighted-blended', 1);
            return [Array.from(new Set(words)), fragments];
        }""",
        {"eye": [0, 0, 0.5], "target": [0, 0, 0], "up": [0, 1, 0], "fov": 38},
    )
    assert fragments == layers * PIXELS
    through = display8(np.full((1, 1, 3), (254 / 255) ** layers, dtype=np.float32))  # of white, by black glass
    assert abs(min(word & 255 for word in words) - int(through[0, 0, 0])) <= 1  # where no highlight is on the glass
    page.locator("#scene").select_option("glass shells")
    assert tab.faults == []


def test_files_may_be_dropped_anywhere(tab: Tab) -> None:
    page = tab.page
    dropped = page.evaluate(
        """() => {
            const data = new DataTransfer();
            data.items.add(new File(['no glTF'], 'dropped.glb'));
            return ['dragover', 'drop'].map((kind) => {
                const event = new DragEvent(kind, { bubbles: true, cancelable: true, dataTransfer: data });
                document.querySelector('h1').dispatchEvent(event);
                return event.defaultPrevented;
            });
        }"""
    )
    assert dropped == [True, True]
    page.get_by_role("alert").get_by_text("dropped.glb cannot be read").wait_for()
    page.locator("#scene").select_option("a shelf of bottles")
    page.get_by_role("alert").wait_for(state="hidden")
    assert tab.faults == []


def test_scenes_without_glass_and_beyond_the_device_are_no_faults(tab: Tab, tmp_path: Path) -> None:
    page = tab.page
    trimesh.creation.box().export(tmp_path / "box.glb")
    page.get_by_label("A file of your own").set_input_files(tmp_path / "box.glb")
    page.locator("#facts").get_by_text("pixels, 0 transparent fragments").wait_for()
    page.locator("#figures tr").nth(1).get_by_text("exact", exact=True).wait_for()  # the exact picture was made
    wide = trimesh.visual.TextureVisuals(uv=np.zeros((8, 2)), image=Image.new("1", (20_000, 1)))
    trimesh.Trimesh(**trimesh.creation.box().to_dict(), visual=wide).export(tmp_path / "wide.glb")
    _refused(tab, tmp_path / "wide.glb", "An image of 20000 × 1 is above this device's limit")
    page.get_by_label("Split").fill("40")
    assert page.get_by_label("Scene").locator("option").nth(0).inner_text() == "box.glb"  # it is still there
    page.locator("#scene").select_option("glass shells")
    page.get_by_role("alert").wait_for(state="hidden")
    assert tab.faults == []


def test_a_lost_device_is_said_once(webgpu: Any, api: Api, url: str) -> None:
    opened = Tab(webgpu, url, 640, "light")
    page = opened.page
    page.add_init_script(
        """const { requestDevice } = GPUAdapter.prototype;
        GPUAdapter.prototype.requestDevice = async function (...all) {
            return (globalThis.device = await requestDevice.apply(this, all));
        };"""
    )
    page.goto("/demo")
    page.locator("#figures tr").nth(1).wait_for()
    page.evaluate("device.destroy()")
    page.get_by_role("alert").get_by_text("The graphics device was lost.").wait_for()
    page.get_by_label("Budget").fill("1")
    page.locator("#stage").press("ArrowLeft")
    page.locator("#scene").select_option("a shelf of bottles")
    page.locator("#status:empty").wait_for(state="attached")
    assert page.get_by_role("alert").inner_text().startswith("The graphics device was lost.")
    assert opened.faults == []
    opened.context.close()


def test_where_nothing_may_be_kept_the_page_works(webgpu: Any, api: Api, url: str) -> None:
    opened = Tab(webgpu, url, 640, "light")
    denied = (
        "Object.defineProperty(globalThis, 'localStorage', { get() { throw new DOMException('', 'SecurityError') } })"
    )
    opened.page.add_init_script(denied)
    opened.sign_in(api.secrets["read"], "/models")
    opened.page.goto("/demo")
    opened.page.locator("#model-note").get_by_text("self-test passes").wait_for()
    assert opened.faults == []
    opened.context.close()


def test_a_tampered_model_stays_said_when_a_scene_is_opened(webgpu: Any, api: Api, url: str) -> None:
    opened = Tab(webgpu, url, 640, "light")
    page = opened.page
    opened.sign_in(api.secrets["read"], "/models")
    page.route("**/demo/v1/blobs/**", lambda route: route.fulfill(body="something else"))
    page.goto("/demo")
    alert = page.get_by_role("alert").get_by_text("is not the file that was published")
    alert.wait_for()
    page.locator("#scene").select_option("a shelf of bottles")
    page.locator("#status:empty").wait_for(state="attached")
    assert alert.is_visible()
    assert page.get_by_label("Right").locator("option[value=kbuffer-deep]").count() == 0
    assert opened.faults == []
    opened.context.close()


@pytest.mark.parametrize(("width", "scheme"), [(640, "light"), (360, "dark")])
def test_nobody_signed_in_sees_what_needs_no_model(webgpu: Any, url: str, width: int, scheme: str) -> None:
    opened = Tab(webgpu, url, width, scheme)
    page = opened.page
    page.goto("/demo")
    page.locator("#figures tr").nth(1).wait_for()
    assert page.get_by_role("link", name="Sign in").get_attribute("href") == "/sign-in?next=%2Fdemo"
    assert page.get_by_label("Left").locator("option[value=kbuffer-deep]").count() == 0
    assert page.get_by_role("alert").count() == 0
    assert page.evaluate(AUDIT) == []
    assert page.evaluate("document.scrollingElement.scrollWidth") <= width
    assert opened.faults == []
    opened.context.close()


@pytest.mark.parametrize(
    ("missing", "said"),
    [
        ("Object.defineProperty(Navigator.prototype, 'gpu', { value: undefined })", "This browser has no WebGPU."),
        ("Object.defineProperty(globalThis, 'isSecureContext', { value: false })", "on secure pages only"),
        ("GPU.prototype.requestAdapter = async () => null", "no graphics adapter for it"),
        ("GPUAdapter.prototype.requestDevice = () => Promise.reject(new Error())", "cannot open the graphics device"),
        ("HTMLCanvasElement.prototype.getContext = () => null", "cannot show what WebGPU draws"),
    ],
    ids=["no-webgpu", "http", "no-adapter", "no-device", "no-canvas"],
)
def test_without_webgpu_the_page_says_what_to_do(webgpu: Any, url: str, missing: str, said: str) -> None:
    opened = Tab(webgpu, url, 1280, "dark")
    opened.page.add_init_script(missing)
    opened.page.goto("/demo")
    opened.page.get_by_role("alert").get_by_text(said).wait_for()
    assert opened.page.locator("#status").inner_text() == "There is nothing to see without WebGPU."
    assert opened.page.get_by_label("Left").is_disabled()
    assert opened.page.evaluate(AUDIT) == []
    assert opened.faults == []
    opened.context.close()


def test_a_sample_that_does_not_come_is_said(webgpu: Any, url: str) -> None:
    opened = Tab(webgpu, url, 640, "light")
    opened.page.route("**/*.glb", lambda route: route.abort())
    opened.page.goto("/demo")
    opened.page.get_by_role("alert").get_by_text("The sample cannot be loaded.").wait_for()
    opened.page.locator("#status:empty").wait_for(state="attached")
    assert [fault for fault in opened.faults if "net::ERR_FAILED" not in fault] == []
    opened.context.close()


def test_without_scripts_the_page_says_so(webgpu: Any, url: str) -> None:
    context = webgpu.new_context(base_url=url, java_script_enabled=False)
    page = context.new_page()
    page.goto("/demo")
    assert "Allow scripts for it" in page.locator("noscript p").inner_text()
    context.close()


def test_the_page_is_open_and_strict(api: Api) -> None:
    answer = Visitor(api, None).get("/demo")
    assert answer.status_code == 200
    assert answer.headers["content-security-policy"] == POLICY
    assert "<script>" not in answer.text
    assert "style=" not in answer.text
    assert Visitor(api, None).get("/demo", **{"If-None-Match": answer.headers["etag"]}).status_code == 304
    for name in ("../index.html", "%2e%2e%2findex.html", "none.js", "..%2f..%2fdashboard.css"):
        assert Visitor(api, None).get(f"/demo/assets/{name}").status_code == 404
    for path in (demo.BUILT.folder / "assets").iterdir():
        asset = Visitor(api, None).get(f"/demo/assets/{path.name}")
        assert asset.content == path.read_bytes()
        assert "immutable" in asset.headers["cache-control"]


def test_the_registry_answers_to_a_session_as_to_a_key(api: Api) -> None:
    visitor = Visitor(api, "read")
    assert visitor.get("/demo/session").json() == {"signed_in": True}
    assert Visitor(api, None).get("/demo/session").json() == {"signed_in": False}
    blob = api.get("/v1/models/glass/versions/champion").json()["files"]["predict.wgsl"]["sha256"]
    paths = ("/models", "/models/glass/versions/champion", f"/blobs/sha256/{blob}")
    assert {route.path for router in SESSION_ANSWERS for route in router.routes} == {  # type: ignore[attr-defined]
        "/demo/v1/models",
        "/demo/v1/models/{name}/versions/{version}",
        "/demo/v1/models/{name}/pointers/{version}",
        "/demo/v1/blobs/sha256/{sha256}",
    }
    for path in paths:
        assert visitor.get(f"/demo/v1{path}").content == api.get(f"/v1{path}").content
        for stranger in (Visitor(api, None).client.get(f"/demo/v1{path}"), api.get(f"/demo/v1{path}", "admin")):
            assert stranger.status_code == 401  # a key is none here
            assert stranger.headers["content-type"] == "application/problem+json"
        assert visitor.client.post(f"/demo/v1{path}").status_code == 405
    pointer = visitor.get("/demo/v1/models/glass/pointers/champion")
    assert pointer.headers["cache-control"] == "no-store"
    assert pointer.json().keys() == api.get("/v1/models/glass/pointers/champion").json().keys()
    assert Visitor(api, None).client.get("/demo/v1/models/glass/pointers/champion").status_code == 401


def test_the_build_is_small() -> None:
    assert sum(path.stat().st_size for path in demo.BUILT.folder.rglob("*") if path.is_file()) < 300_000
