"""The page Compare from the server's side: pictures, maps and pixels against float64; what is gone, bad or hostile."""

from __future__ import annotations

import io
import re
import subprocess
import sys
from pathlib import Path
from urllib.parse import urlencode

import numpy as np
import pytest
from PIL import Image
from support.api import Api, measurement
from support.charts import DATA
from support.compare import CAMERA, FACTORS, HOSTILE_VIEW, MODELS, RULES, TAIL, Filled, G, fill
from support.dashboard import Visitor
from support.postgres import Postgres

from evaluation.pictures import counts_map, read_png, write_png
from evaluation.report import colours
from labeller import reference
from labeller.hull import lower_hulls
from renderer import metrics
from renderer.dump import read_dump
from renderer.dump_pixels import DumpReader
from renderer.exr import read_exr
from schemas.colour import display8
from schemas.problem import ExitCode, Problem
from services import scene_views
from services.dashboard import sides
from services.dashboard.compare import Comparer
from services.dashboard.measured import history, of_version
from services.dashboard.pixels import RULE_TITLES
from services.database import tables
from services.kept import Kept
from services.scene_views import views


@pytest.fixture(scope="module")
def api(tmp_path_factory: pytest.TempPathFactory) -> Api:
    return Api(tmp_path_factory.mktemp("compare"), rate=1e6, burst=10**6)


@pytest.fixture(scope="module")
def filled(api: Api) -> Filled:
    return fill(api)


@pytest.fixture(scope="module")
def reader(api: Api, filled: Filled) -> Visitor:
    return Visitor(api, "read")


def _query(filled: Filled, **more: object) -> str:
    return urlencode({"scene": filled.scene, "view": "front", **more})


def _picture(reader: Visitor, filled: Filled, **more: object) -> np.ndarray:
    answer = reader.get(f"/compare/picture.png?{_query(filled, **more)}")
    assert (answer.status_code, answer.headers["content-type"]) == (200, "image/png"), answer.text
    return np.asarray(Image.open(io.BytesIO(answer.content)).convert("RGB"))


def _said(page: str, view: str = "front") -> dict[str, str]:
    return dict(re.findall(r"<dt>(.*?)</dt><dd>(.*?)</dd>", page, flags=re.S))


def test_the_page_offers_all_that_was_measured(reader: Visitor, filled: Filled) -> None:
    page = reader.get(f"/compare?scene={filled.scene}").text
    techniques = [f"{name}:{factor:g}" for name in (*RULES, *MODELS) for factor in FACTORS]
    (first,) = re.findall(r'<select id="a".*?</select>', page, flags=re.S)
    assert sorted(re.findall(r'option value="([^"]+)"', first)) == sorted(["exact", *techniques])
    assert 'value="kbuffer-importance:2" selected' in page  # against what is compared first
    assert 'value="glass@1.1.0:2" selected' in page
    assert reader.get("/compare").text == page  # the scene that was measured last
    linked = reader.get("/compare?model=glass@1.0.0").text
    assert re.search(r'value="glass@1.0.0:\d" selected', linked)


def test_what_a_local_build_measured_is_compared_though_its_scene_was_never_uploaded(tmp_path: Path) -> None:
    api = Api(tmp_path)
    scene = fill(api, (8, 6), 6).scene
    digest = api.service.scenes.get(scene).digest
    with api.service.database.write() as connection:
        connection.execute(tables.scenes.delete())
    reader = Visitor(api, "read")
    page = reader.get("/compare?model=glass@1.0.0").text
    assert f'<option value="{digest}" selected>' in page
    assert f"/scenes/{digest}" not in page
    assert reader.get(f"/compare/picture.png?{urlencode({'scene': digest, 'view': 'front', 'a': 'exact'})}").is_success
    assert reader.get(f"/compare?scene={scene}").status_code == 404


def test_pages_lead_there(api: Api, reader: Visitor, filled: Filled) -> None:
    assert (
        f'href="/compare?scene={filled.scene}&amp;view=front"' in reader.get(f"/scenes/{filled.scene}?view=front").text
    )
    assert 'href="/compare"' in reader.get("/").text


@pytest.mark.parametrize("key", ["exact", "kbuffer:1", "kbuffer-optimal:2", "glass@1.0.0:1"])
def test_pictures_are_those_that_were_rendered(reader: Visitor, filled: Filled, key: str, tmp_path: Path) -> None:
    view = filled.views["front"]
    name, _, factor = key.partition(":")
    k = view.dump.counts if key == "exact" else view.k({**RULES, **MODELS}[name], float(factor))
    expected = np.array(
        [
            reference.composite(reference.pixel_of(view.dump, p), min(int(k[p]), int(n)), TAIL, G)
            for p, n in enumerate(view.dump.counts)
        ]
    ).reshape(view.dump.height, view.dump.width, 3)
    found = _picture(reader, filled, a=key)
    assert np.abs(found.astype(int) - display8(expected).astype(int)).max() <= 1
    answer = reader.get(f"/compare/picture.exr?{_query(filled, a=key)}")
    (tmp_path / "a.exr").write_bytes(answer.content)
    linear = read_exr(tmp_path / "a.exr")
    np.testing.assert_allclose(linear, expected, rtol=1e-3, atol=1e-6)  # half floats
    assert re.search(r'filename="[A-Za-z0-9.-]+\.exr"', answer.headers["content-disposition"])


def test_maps_are_what_they_say(reader: Visitor, filled: Filled) -> None:
    view, keys = filled.views["front"], {"a": "kbuffer:1", "b": "glass@1.1.0:1"}
    a, b = (_picture(reader, filled, a=key) for key in keys.values())
    difference = _picture(reader, filled, **keys, show="difference", amplify=4)
    assert difference.tolist() == np.minimum(4 * np.abs(a.astype(int) - b.astype(int)), 255).tolist()
    k = view.k("fixed", 1.0).reshape(view.dump.height, view.dump.width)
    counts = _picture(reader, filled, a=keys["a"], show="k", top=3)
    assert counts.tolist() == colours.apply(np.sqrt(k / np.float32(3)), colours.COUNT).tolist()
    for pair, (test, against) in {
        ("kbuffer:1", "glass@1.1.0:1"): (b, a),
        ("exact", "kbuffer:1"): (a, _picture(reader, filled, a="exact")),
        ("kbuffer:1", "exact"): (a, _picture(reader, filled, a="exact")),
    }.items():
        found = _picture(reader, filled, a=pair[0], b=pair[1], show="flip").astype(int)
        expected = colours.apply(np.sqrt(metrics.flip(test, against)[1]), colours.HEAT).astype(int)
        assert np.abs(found - expected).max() <= 8  # the stored maps have 8 bits
    assert _picture(reader, filled, a="exact", b="exact", show="flip").max() == 4  # black of the scale: no error


def test_a_picture_is_asked_for_again_only_if_it_changed(reader: Visitor, filled: Filled) -> None:
    path = f"/compare/picture.png?{_query(filled, a='kbuffer:1')}"
    answer = reader.get(path)
    assert answer.headers["cache-control"] == "private, no-cache"
    again = reader.get(path, **{"If-None-Match": answer.headers["etag"]})
    assert (again.status_code, again.content) == (304, b"")
    other = reader.get(f"/compare/picture.png?{_query(filled, a='kbuffer:2')}")
    assert other.headers["etag"] != answer.headers["etag"]


@pytest.mark.parametrize("view", ["front", HOSTILE_VIEW])
def test_a_pixel_is_what_float64_makes_of_it(reader: Visitor, filled: Filled, view: str) -> None:
    made = filled.views[view]
    dump, a, b = made.dump, made.k("importance", 1.0), made.k("increment", 2.0)
    keys, hulls = {"a": "kbuffer-importance:1", "b": "glass@1.1.0:2"}, lower_hulls(made.curves)
    for p in (0, 7, 100, int(dump.counts.argmax()), int(dump.counts.argmin()), dump.pixels - 1):
        x, y, n = p % dump.width, p // dump.width, int(dump.counts[p])
        answer = reader.get(f"/compare/pixel?{_query(filled, x=x, y=y, **keys, **{'view': view})}")
        assert answer.status_code == 200
        page, one = answer.text, reference.pixel_of(dump, p)
        assert f"{n} fragments; " in page
        if n == 0:
            assert "No transparent fragment" in page
            continue
        curve = reference.curve(dump, p, TAIL, G)
        rows = [
            re.findall(r"<t[hd][^>]*>(.*?)</t[hd]>", row)
            for row in re.findall(r"<tr><th scope=\"row\">.*?</tr>", page, flags=re.S)
        ]
        assert [int(row[0]) for row in rows] == list(range(1, n + 1))
        np.testing.assert_allclose([float(row[3]) for row in rows], one.depth, atol=6e-5)
        hexes = ["#{:02x}{:02x}{:02x}".format(*colour) for colour in display8(one.colour)]
        assert [re.search(r"#[0-9a-f]{6}", row[4])[0] for row in rows] == hexes  # type: ignore[index]
        np.testing.assert_allclose([float(row[5]) for row in rows], one.alpha, atol=6e-4)
        passes = [np.prod(1.0 - one.alpha[:i]) for i in range(n)]
        np.testing.assert_allclose([float(row[6]) for row in rows], passes, atol=6e-5)
        np.testing.assert_allclose([float(row[7]) for row in rows], 1e5 * curve[1:], rtol=6e-3, atol=1e-6)
        for column, k in ((1, int(a[p])), (2, int(b[p]))):
            assert [row[column] for row in rows] == ["core"] * k + ["tail"] * (n - k)
        vertices = hulls.k[hulls.offsets[p] : hulls.offsets[p + 1]].tolist()
        assert [int(row[0]) for row in rows if row[8]] == [k for k in vertices if k]  # k = 0 has no fragment's row
        tables = re.findall(r"k of every rule at F = (\S+) W H</caption>(.*?)</table>", page, flags=re.S)
        assert [factor for factor, _ in tables] == ["1", "2"]
        for factor, table in tables:
            said = dict(re.findall(r'scope="row">(.*?)</th><td>(\d+)</td>', table))
            rules = {title: str(made.k(rule, float(factor))[p]) for rule, title in RULE_TITLES.items()}
            models = {name: str(made.k(rule, float(factor))[p]) for name, rule in MODELS.items()}
            assert said == {**rules, **models}


def test_a_pixel_can_be_part_of_the_page(reader: Visitor, filled: Filled) -> None:
    keys = {"a": "exact", "b": "kbuffer:1", "x": 3, "y": 2, "mode": "flip", "zoom": 4, "amplify": 16}
    page = reader.get(f"/compare?{_query(filled, **keys)}").text
    part = reader.get(f"/compare/pixel?{_query(filled, **{k: keys[k] for k in 'abxy'})}").text
    assert part.strip() in page
    assert 'value="flip" checked' in page
    assert '<option value="4" selected>4×</option>' in page
    assert '<option value="16" selected>×16</option>' in page
    assert 'name="x" class="short" inputmode="numeric" pattern="[0-9]*" maxlength="5" value="3"' in page
    assert "show=flip" in re.findall(r'<img id="picture-map" src="([^"]+)"', page)[0]


def test_an_unknown_side_view_or_scene_is_a_page_that_says_so(reader: Visitor, filled: Filled) -> None:
    for more, said in (
        ({"a": "kbuffer:9"}, "it was not measured"),
        ({"b": "glass@9.9.9:1"}, "it was not measured"),
        ({"a": "kbuffer:99"}, "the budget holds every fragment"),
        ({"view": "nowhere"}, "Nothing was measured on a view"),
        ({"scene": "scn_" + "0" * 32}, "There is no scene"),
    ):
        for route in ("", "/pixel", "/picture.png", "/picture.exr"):
            answer = reader.get(f"/compare{route}?{_query(filled, **{'x': 1, 'y': 1, **more})}")
            assert (answer.status_code, said in answer.text, "What to do:" in answer.text) == (404, True, True)
    assert reader.get("/compare?model=glass@9.9.9").status_code == 404
    near = reader.get(f"/compare?{_query(filled, view='nowhere', a='kbuffer:9', near=1)}")
    assert near.status_code == 200
    assert "kbuffer:9" not in near.text


@pytest.mark.parametrize(
    "bad",
    [
        {"scene": "../../etc/passwd"},
        {"a": "../../meta.json:1"},
        {"a": "kbuffer/../../x"},
        {"b": "<script>"},
        {"view": "a\0b"},
        {"view": "x" * 201},
        {"mode": "odd"},
        {"zoom": "3"},
        {"amplify": "9999"},
        {"x": "-1"},
        {"y": "1e9"},
        {"model": "glass"},
    ],
)
def test_bad_queries_are_refused(reader: Visitor, filled: Filled, bad: dict[str, str]) -> None:
    answer = reader.get(f"/compare?{_query(filled, **bad)}")
    assert (answer.status_code, answer.headers["content-type"].partition(";")[0]) == (422, "text/html")
    assert f"&#39;{next(iter(bad))}&#39; in the address has to " in answer.text
    assert "<script>" not in answer.text
    assert "etc/passwd" not in answer.text


def test_numbers_out_of_range_are_refused(reader: Visitor, filled: Filled) -> None:
    for path in ("pixel?x=24&y=0", "pixel?x=0&y=16", "pixel?x=-1&y=0", "pixel?x=1", "picture.png?top=0&show=k"):
        assert reader.get(f"/compare/{path}&{_query(filled)}").status_code == 422, path
    assert reader.get(f"/compare/picture.exr?{_query(filled, show='flip')}").status_code == 422


def test_a_hostile_view_is_text(reader: Visitor, filled: Filled) -> None:
    query = _query(filled, **{"view": HOSTILE_VIEW, "x": 1, "y": 1})
    for path in (f"/compare?{query}", f"/compare/pixel?{query}", f"/scenes/{filled.scene}"):
        page = reader.get(path).text
        assert "<b onclick" not in page
        assert not re.search(r"<style|\sstyle=|javascript:", page)
    page = reader.get(f"/compare?{query}").text
    assert "&lt;b onclick=x&gt;" in page
    for source in re.findall(r'src="(/compare[^"]+)"', page):
        assert reader.get(source.replace("&amp;", "&")).status_code == 200
    name = reader.get(f"/compare/picture.png?{query}").headers["content-disposition"]
    assert re.fullmatch(r'inline; filename="[A-Za-z0-9.-]+"', name)


def test_the_page_is_made_for_every_reader_and_for_the_policy(reader: Visitor, filled: Filled) -> None:
    for mode in ("slider", "flip"):
        page = reader.get(f"/compare?{_query(filled, x=3, y=3, mode=mode)}").text
        assert (page.count("<h1"), page.count("<main")) == (1, 1)
        assert not re.search(r"<img(?![^>]* alt=)", page)
        assert not re.search(r"<th(?![^>]*scope=)[ >]", page)
        ids = re.findall(r'\sid="([^"]+)"', page)
        assert len(ids) == len(set(ids))
        assert set(re.findall(r'<label for="([^"]+)"', page)) <= set(ids)
        assert not re.search(r"<script(?! src=\"/static/)", DATA.sub("", page))


def test_nothing_measured_says_what_to_do(tmp_path: Path) -> None:
    empty = Api(tmp_path)
    answer = Visitor(empty, "read").get("/compare")
    assert answer.status_code == 200
    assert "diaphane jobs submit evaluate" in answer.text
    scene = empty.scene()
    assert Visitor(empty, "read").get(f"/compare?scene={scene}").status_code == 404


def test_many_versions_leave_room_for_what_they_are_compared_with(
    api: Api, reader: Visitor, filled: Filled, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Techniques without a model are measured once, before all versions."""
    digest = api.service.scenes.get(filled.scene).digest
    shown = {one.name: len(one.shots) for one in views(api.service.database, digest)}
    monkeypatch.setattr(scene_views, "_MOST_ROWS", 16)
    monkeypatch.setattr(sides, "_MOST_ROWS", 8)
    assert {one.name: len(one.shots) for one in views(api.service.database, digest)} == shown
    page = reader.get(f"/compare?{_query(filled)}").text
    assert [f'value="{name}:{factor:g}"' in page for name in RULES for factor in FACTORS] == [True] * 6


_MOVED = CAMERA.model_copy(update={"eye": (0.0, 1.0, 3.0), "fov": 30.0})


@pytest.mark.parametrize(
    ("otherwise", "said"),
    [
        ({"camera": _MOVED}, "measured from another camera of the same name (eye, fov)"),
        ({"camera": None}, "its camera, or that of what was measured last, was not recorded"),
        ({"alpha": 0.5}, "measured with the materials&#39; own opacity"),
        ({"width": 12, "height": 2}, "measured at 6 x 4 pixels"),
        ({"tail": "density"}, "measured with the tail density-16"),
        ({"total_fragments": 7}, "fragments, not 7, as another version reads the scene"),
    ],
    ids=lambda one: one if isinstance(one, str) else ", ".join(one),
)
def test_what_was_measured_otherwise_is_not_compared_and_it_is_said_why(
    otherwise: dict[str, object], said: str, tmp_path: Path
) -> None:
    """A view's name tells little: what was measured last counts, and all else of that name is left out."""
    api = Api(tmp_path, rate=1e6, burst=10**6)
    filled, reader = fill(api, (6, 4)), Visitor(api, "read")
    total = filled.views["front"].dump.total
    same = {"width": 6, "height": 4, "tail": TAIL, "total_fragments": total, "camera": CAMERA}
    digest = api.service.scenes.get(filled.scene).digest
    last = measurement(**{**same, **otherwise})
    api.service.measured.record(f"evaluate/{'0' * 64}", [last], {"bottles": digest}, None, None)
    page = reader.get(f"/compare?{_query(filled)}").text
    (offered,) = re.findall(r'<select id="a".*?</select>', page, flags=re.S)
    assert re.findall(r'option value="([^"]+)"', offered) == ["exact", "kbuffer:1"]
    assert re.search(rf"<code>glass@1.0.0:1</code>: [^<]*{re.escape(said)}", page)
    answer = reader.get(f"/compare?{_query(filled, a='glass@1.0.0:1')}")
    assert (answer.status_code, said in answer.text) == (404, True)
    (seen,) = [view for view in views(api.service.database, digest) if view.name == "front"]
    assert [shot.measured for shot in seen.shots] == [last]
    assert of_version(api.service.database, "glass@1.0.0") != []  # its own setting, with the techniques measured there
    (history_of,) = history(api.service.database, "glass", ["1.0.0", "1.1.0"])
    assert history_of.errors[1] is not None
    assert history_of.errors[1].ratio is not None


def test_versions_are_compared_on_the_same_camera_only(tmp_path: Path) -> None:
    api = Api(tmp_path)
    for number, camera in enumerate((CAMERA, _MOVED, _MOVED.model_copy(update={"name": "renamed"}))):
        found = [measurement(technique="kbuffer-deep", camera=camera, mse=0.1 * (number + 1))]
        api.service.measured.record(
            f"evaluate/{number:064x}", found, {"bottles": "1" * 64}, f"glass@1.{number}.0", None
        )
    (one,) = history(api.service.database, "glass", ["1.0.0", "1.1.0", "1.2.0"])
    ratios = [error.ratio for error in one.errors if error is not None]
    assert ratios == [None, None, pytest.approx(1.5)]


def test_what_was_removed_is_said(tmp_path: Path) -> None:
    api = Api(tmp_path, rate=1e6, burst=10**6)
    filled, reader = fill(api, (6, 4)), Visitor(api, "read")
    view, store = filled.views["front"], api.service.storage.store
    p = int(view.dump.counts.argmax())
    keys = {"a": "kbuffer:1", "b": "glass@1.0.0:1"}
    pixel = f"/compare/pixel?{_query(filled, x=p % 6, y=p // 6, **keys)}"

    def look_anew() -> str:
        api.app.state.comparer = Comparer(api.service)  # what a process has in memory stays right
        return str(reader.get(pixel).text)

    assert "were removed" not in look_anew()
    store.remove(view.label.artifact)
    assert "with the k of every rule, were removed" in look_anew()
    assert "Fragments, front to back" in look_anew()
    store.remove(view.render.artifact)
    assert "The fragments behind A and B were removed" in reader.get(pixel).text
    assert "The fragments behind A and B were removed" in look_anew()
    store.remove(view.evaluations["glass@1.0.0"].artifact)
    assert "The pictures of B were removed" in look_anew()
    page = reader.get(f"/compare?{_query(filled, **keys)}")
    assert (page.status_code, "The pictures of B (glass@1.0.0, F = 1 W H) were removed" in page.text) == (200, True)
    for suffix in ("png", "exr"):
        answer = reader.get(f"/compare/picture.{suffix}?{_query(filled, a=keys['b'])}")
        assert (answer.status_code, "removed because of its age" in answer.text) == (404, True)
    command = f"diaphane jobs submit evaluate --scene {filled.scene} --model glass@1.0.0 --size 6x4 --budgets 1,2"
    for at in (f"/compare?{_query(filled, **keys)}", pixel):
        assert f"{command} --tail {TAIL}</code>" in reader.get(at).text, "a job that succeeded cannot be retried"
    (store.fetch(view.evaluations[None].artifact) / "kbuffer-1.exr").unlink()
    assert reader.get(f"/compare/picture.exr?{_query(filled, a='kbuffer:1')}").status_code == 404


def test_a_store_that_is_away_is_no_removed_artifact(
    api: Api, reader: Visitor, filled: Filled, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> None:
        raise Problem("The object store cannot be reached.", "Try again.", ExitCode.TRY_AGAIN)

    monkeypatch.setattr(type(api.service.storage.store), "holds", fail)
    answer = reader.get(f"/compare/pixel?{_query(filled, x=1, y=1)}")
    assert (answer.status_code, "cannot be reached" in answer.text) == (503, True)


def test_the_same_comes_from_postgresql(postgres: Postgres, tmp_path: Path) -> None:
    api = Api(tmp_path, postgres.new_database(), rate=1e6, burst=10**6)
    filled, reader = fill(api, (6, 4)), Visitor(api, "read")
    for path in ("/compare", "/compare?model=glass@1.0.0", f"/compare/pixel?{_query(filled, x=1, y=1)}"):
        assert reader.get(path).status_code == 200, path
    assert _picture(reader, filled, a="exact").shape == (4, 6, 3)
    (one,) = history(api.service.database, "glass", ["1.0.0", "1.1.0"])
    assert one.errors[1] is not None
    assert one.errors[1].ratio is not None


def test_only_so_many_pictures_are_made_at_once(
    api: Api, reader: Visitor, filled: Filled, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(api.app.state.comparer, "_asked", 16)
    answer = reader.get(f"/compare/picture.png?{_query(filled)}")
    assert (answer.status_code, answer.headers["retry-after"]) == (503, "2")
    assert reader.get(f"/compare?{_query(filled)}").status_code == 200


def test_a_reader_of_pixels_reads_what_the_whole_dump_has(api: Api, filled: Filled) -> None:
    view = filled.views["front"]
    folder = api.service.storage.store.fetch(view.render.artifact)
    pixels, whole = DumpReader(folder), read_dump(folder)
    for p in (0, 5, whole.pixels - 1):
        part, one = slice(whole.offsets[p], whole.offsets[p + 1]), pixels.pixel(p)
        assert one.rgba.tolist() == whole.rgba[part].tolist()
        assert one.depth.tolist() == whole.depth[part].tolist()
        assert one.background.tolist() == [whole.background[p].tolist()]
        assert one.facing.tolist() == [whole.facing[p]]


def test_counts_are_kept_exactly(tmp_path: Path) -> None:
    for most, kind in ((255, np.uint8), (256, np.uint16), (65_535, np.uint16)):
        k = np.array([[0, 1, most]], dtype=np.int32)
        write_png(tmp_path / "k.png", counts_map(k))
        found = read_png(tmp_path / "k.png")
        assert (found.tolist(), found.dtype) == (k.tolist(), kind)


def test_what_is_kept_stays_within_its_bound() -> None:
    kept, made = Kept(100), []

    def value(name: str) -> bytes:
        return kept.get(name, lambda: made.append(name) or bytes(40), len)

    for name in ("a", "b", "a", "c", "a", "b"):
        assert value(name) == bytes(40)
    assert made == ["a", "b", "c", "b"]
    assert kept.get("large", lambda: bytes(101), len) == bytes(101)
    assert value("a") == bytes(40)
    assert made == ["a", "b", "c", "b"]


def test_pages_need_neither_numba_nor_a_renderer() -> None:
    """The API's image has no numba, OpenGL, OpenEXR, FLIP or torch."""
    heavy = "{'numba', 'moderngl', 'OpenEXR', 'flip_evaluator', 'torch', 'pxr', 'onnx'}"
    modules = "services.api.application, services.dashboard.compare, stages.allocations, renderer.dump"
    code = f"import sys, {modules}; print(sorted({heavy} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (0, "[]\n"), done.stderr
