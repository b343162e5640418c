from __future__ import annotations

import contextlib
import pickle
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from attacks import glbs, make, packages
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image
from pxr import Sdf, Usd

from renderer.gate import REMEDIES, RejectedScene, ended
from renderer.gate.archive import read_package
from renderer.gate.check import check_upload
from renderer.gate.gltf import check_glb
from renderer.gate.images import check_image
from renderer.gate.names import check_file_name, check_reference
from renderer.gate.problems import shown
from renderer.gate.text import check_text
from renderer.samples import SAMPLES
from schemas.limits import LIMITS

ACCEPT = Path(make.__file__).parent / "accept"


def test_problems_pass_between_processes_and_are_known_without_usd() -> None:
    problem = pickle.loads(pickle.dumps(RejectedScene("scene-url", "A.", "B.")))
    assert (problem.slug, problem.title, problem.remedy) == ("scene-url", "A.", "B.")
    assert ended("a.usd", True).slug == "scene-too-large"
    assert ended("a.usd", False).slug == "scene-damaged"
    script = "import sys, renderer.gate; sys.exit('pxr' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", script], cwd=ACCEPT.parents[2]).returncode == 0
    assert all(remedy.endswith(".") for remedy in REMEDIES.values())


@pytest.mark.parametrize("name", ["a.usd", "a b/c-d_e.png", "d\u00e9cor/\u6728.png", "a..b.png", "...usd"])
def test_plain_names_are_accepted(name: str) -> None:
    assert check_file_name(name) == name
    assert check_reference(f"./{name}", "x") == name
    assert check_reference(name, "x") == name


@pytest.mark.parametrize(
    "name", ["", "/a", "a//b", "a/", "a/./b", "C:/a", "a\nb", "a\\b", "a:b", "x" * 600, "a/../b", ".."]
)
def test_other_names_of_files_are_refused(name: str) -> None:
    with pytest.raises(RejectedScene):
        check_file_name(name)


@given(st.text(alphabet="ab./\\:%2eEfF\u2025\uff0e\uff0f~@`[]$ \u202e", max_size=12))
def test_no_reference_that_is_accepted_leads_out(text: str) -> None:
    try:
        path = check_reference(text, "x")
    except RejectedScene:
        return
    for part in path.replace("[", "/").replace("]", "").split("/"):
        assert part != ".."
    assert not path.startswith(("/", "~"))
    assert not set(path) & set("\\:`$")
    home = Path("/home/x").resolve()
    assert (home / path).resolve().is_relative_to(home)


@given(
    st.text(alphabet="ab./\\[]", max_size=14)
    | st.lists(st.sampled_from(["..", ".", "a", "", "b"]), max_size=7).map("/".join),
    st.integers(0, 3),
)
def test_a_reference_climbs_no_higher_than_the_upload(text: str, depth: int) -> None:
    try:
        path = check_reference(text, "x", depth)
    except RejectedScene:
        return
    top = Path("/home/x").resolve()
    layer = top.joinpath(*["d"] * depth)
    assert (layer / path.replace("[", "/").replace("]", "")).resolve().is_relative_to(top)


@pytest.mark.parametrize(("ups", "accepted"), [("../../", True), ("../../../", False)])
def test_a_layer_may_refer_upwards_inside_the_upload(tmp_path: Path, ups: str, accepted: bool) -> None:
    (tmp_path / "cars" / "parts").mkdir(parents=True)
    (tmp_path / "shared.usda").write_text('#usda 1.0\ndef Mesh "M" {\n}\n')
    door, car = (
        f'#usda 1.0\ndef "A" (\nreferences = @{path}@</{prim}>\n) {{\n}}\n'
        for path, prim in ((f"{ups}shared.usda", "M"), ("./parts/door.usda", "A"))
    )
    (tmp_path / "cars" / "parts" / "door.usda").write_text(door)
    (tmp_path / "cars" / "car.usda").write_text(car)
    if accepted:
        checked = check_upload(tmp_path, "cars/car.usda")
        assert set(checked.layers) == {"cars/car.usda", "cars/parts/door.usda", "shared.usda"}
        return
    with pytest.raises(RejectedScene) as caught:
        check_upload(tmp_path, "cars/car.usda")
    assert caught.value.slug == "scene-path-outside"


def test_a_shown_name_is_printable_and_short() -> None:
    assert shown("a\x1b[31m\u202e" + "b" * 300).isprintable()
    assert len(shown("b" * 300)) <= 80


def test_sizes_of_images_are_read_from_their_headers(tmp_path: Path) -> None:
    pixels = np.zeros((37, 21, 3), np.uint8)
    for name, options in (("a.png", {}), ("a.jpg", {}), ("b.jpg", {"progressive": True})):
        Image.fromarray(pixels).save(tmp_path / name, **options)
        assert check_image(name, (tmp_path / name).read_bytes()) == 37 * 21


@pytest.mark.parametrize(
    "piece", [b'"""', b"'''", b'"\\', b"'''\\\"", b"/*", b"@@@", b"@", b"'", b'("', b"( 1", b"\\", b'"\\\n']
)
def test_the_time_of_the_look_at_brackets_is_linear(piece: bytes) -> None:
    started = time.monotonic()
    with contextlib.suppress(RejectedScene):
        check_text(piece * 200_000, "a")
    assert time.monotonic() - started < 2.0


def test_brackets_in_words_do_not_count() -> None:
    check_text(b'doc = "' + b"((((" * 500 + b'"\n# ' + b"{{{{" * 500 + b"\nx = @" + b"((" * 300 + b"@", "a")
    hidden = b'x = ["' + b")" * 500 + b'", ' + b"[" * 300
    with pytest.raises(RejectedScene):
        check_text(hidden, "a")


@pytest.mark.parametrize("name", ["curtains", "engine", "foliage"])
def test_prims_are_counted_as_the_stage_has_them(name: str, tmp_path: Path) -> None:
    file = SAMPLES[name](tmp_path)
    counted = check_upload(tmp_path, file.name).prims
    stage = Usd.Stage.Open(str(file))
    everything = stage.Traverse(Usd.TraverseInstanceProxies(Usd.PrimAllPrimsPredicate))
    assert counted == sum(1 for _ in everything)


@pytest.mark.parametrize("name", sorted(p.name for p in ACCEPT.iterdir() if p.suffix != ".glb"))
def test_prims_of_small_uploads_are_counted_as_the_stage_has_them(name: str, tmp_path: Path) -> None:
    (tmp_path / name).write_bytes((ACCEPT / name).read_bytes())
    counted = check_upload(tmp_path, name).prims
    stage = Usd.Stage.Open(str(tmp_path / name))
    assert counted == sum(1 for _ in stage.Traverse(Usd.TraverseInstanceProxies(Usd.PrimAllPrimsPredicate)))


def test_limits_are_inclusive(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from renderer.gate import check

    for number in range(3):
        (tmp_path / f"{number}.usda").write_text(make.usda(), encoding="utf-8")
    monkeypatch.setattr(check, "LIMITS", type(LIMITS)(layers=3))
    check_upload(tmp_path, "0.usda")
    monkeypatch.setattr(check, "LIMITS", type(LIMITS)(layers=2))
    with pytest.raises(RejectedScene, match="3 USD layers"):
        check_upload(tmp_path, "0.usda")


def test_a_damaged_layer_that_nothing_uses_does_not_matter(tmp_path: Path) -> None:
    (tmp_path / "a.usda").write_text(make.usda(), encoding="utf-8")
    (tmp_path / "b.usda").write_text("#usda 1.0\n{{{", encoding="utf-8")
    check_upload(tmp_path, "a.usda")
    (tmp_path / "a.usda").write_text(make.prim("references = @./b.usda@"), encoding="utf-8")
    kept = Sdf.Layer.Find(str(tmp_path / "a.usda"))
    if kept:
        kept.Reload()
    with pytest.raises(RejectedScene, match=r"b\.usda cannot be read"):
        check_upload(tmp_path, "a.usda")


def test_a_changed_package_is_refused_or_reads_the_same(tmp_path: Path) -> None:
    good = packages.plain({"a.usda": make.usda().encode(), "t/b.png": make.png()})
    file = tmp_path / "a.usdz"
    file.write_bytes(good)
    names = list(read_package(file, "a.usdz"))
    rng = np.random.default_rng(3)
    refused = 0
    for at in rng.integers(0, len(good), 300):
        changed = bytearray(good)
        changed[at] ^= 1 << int(rng.integers(8))
        file.write_bytes(bytes(changed))
        try:
            assert list(read_package(file, "a.usdz")) == names
        except RejectedScene:
            refused += 1
    assert refused > 150


def test_a_changed_glb_is_refused_or_stays_within_its_bounds(tmp_path: Path) -> None:
    good = glbs.good(make.png())["texture.glb"]
    file = tmp_path / "a.glb"
    rng = np.random.default_rng(4)
    refused = 0
    for at in rng.integers(0, len(good), 500):
        changed = bytearray(good)
        changed[at] ^= 1 << int(rng.integers(8))
        file.write_bytes(bytes(changed))
        try:
            check_glb(file, "a.glb")
        except RejectedScene:
            refused += 1
    assert refused > 100
