"""Pages of the dashboard: what they show, and how some of them look, over a service in which nothing is of chance.

- What a page shows: every text, picture, chart and control in order, visible, in a wide and in a narrow window. A chart
  or a row that is missing is found by name.
- How it looks, of the pages with the most on them. With the browser and the fonts that the golden pictures were made
  with, hardly a pixel may differ. Others draw controls and the edges of letters their own way (hinted letters: 1.5 % of
  the pixels of a page): there a changed colour is not seen, only what breaks the page.

`python -m pytest tests/golden/test_pages.py --golden` writes both anew; look at them before they are committed.
"""

from __future__ import annotations

import hashlib
import io
import json
from collections.abc import Iterator
from dataclasses import dataclass
from difflib import SequenceMatcher
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image
from support.api import Api
from support.browser import FONTS, Tab, font_files
from support.compare import Filled
from support.compare import fill as fill_comparison
from support.dashboard import Shown, fill
from support.frozen import frozen

FOLDER = Path(__file__).parent / "pages"
MADE_WITH = FOLDER / "browser.json"

COLOURS = 64
"""Of a golden picture. The page is compared as its palette shows it, so that the same page is the same."""
NEAR, FAR = 8, 96
"""Differences of a channel, of 255, up to which a pixel counts as the same: with the same browser, and with others."""
SAME, OTHER = 1e-5, 0.02
"""Share of pixels that may differ by more."""
HEIGHT = 0.01
"""Share of the height that another browser may add or leave out."""
TOLD = 12
"""Differences of what is shown that are told."""

OUTLINE = (Path(__file__).parent / "outline.js").read_text(encoding="utf-8").rstrip("\n;")

WINDOWS = ((1280, "light"), (360, "dark"))
LOOKED_AT = {("overview", 1280), ("model", 1280), ("compare", 1280), ("job", 360), ("scene", 360)}
"""Pages, and the widths of the windows that they are pictured in."""

PAGES = ("overview", "jobs", "job", "models", "model", "scenes", "scene", "sign-in")


@pytest.fixture(scope="module")
def api(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Api]:
    with frozen(tmp_path_factory.mktemp("frozen")) as service:
        yield service


@pytest.fixture(scope="module")
def shown(api: Api, tmp_path_factory: pytest.TempPathFactory) -> Shown:
    return fill(api, tmp_path_factory.mktemp("bundles"), "wine glasses")


@pytest.fixture(scope="module")
def url(api: Api, shown: Shown) -> Iterator[str]:
    with api.served() as address:
        yield address


@dataclass(frozen=True)
class Compared:
    """A service of its own with two views to compare, and where it is served."""

    api: Api
    filled: Filled
    url: str


@pytest.fixture(scope="module")
def compared(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Compared]:
    if len(font_files()) < len(FONTS):
        pytest.skip("the DejaVu fonts are not installed")
    with frozen(tmp_path_factory.mktemp("compared")) as service:
        filled = fill_comparison(service, (48, 32))
        with service.served() as address:
            yield Compared(service, filled, address)


@pytest.fixture(scope="module", params=WINDOWS, ids=str)
def tab(request: pytest.FixtureRequest, chromium: Any, url: str, api: Api) -> Iterator[Tab]:
    if len(font_files()) < len(FONTS):
        pytest.skip("the DejaVu fonts are not installed")
    opened = Tab(chromium, url, *request.param)
    opened.sign_in(api.secrets["admin"])
    yield opened
    opened.context.close()


@pytest.mark.parametrize("page", PAGES)
def test_a_page_shows_what_it_did_and_looks_as_it_did(
    page: str, tab: Tab, shown: Shown, chromium: Any, request: pytest.FixtureRequest, tmp_path: Path
) -> None:
    _open(tab, _place(page, shown))
    _check(page, tab, chromium, request, tmp_path)


@pytest.mark.parametrize(("width", "scheme"), WINDOWS)
def test_a_comparison_shows_what_it_did_and_looks_as_it_did(
    width: int,
    scheme: str,
    compared: Compared,
    chromium: Any,
    request: pytest.FixtureRequest,
    tmp_path: Path,
) -> None:
    """A pixel with its fragments, curve and rules under maps of a picture."""
    tab = Tab(chromium, compared.url, width, scheme)
    tab.sign_in(compared.api.secrets["read"])
    _open(tab, f"/compare?scene={compared.filled.scene}&view=front&mode=k-b&x=20&y=11")
    _check("compare", tab, chromium, request, tmp_path)
    tab.context.close()


def _check(page: str, tab: Tab, chromium: Any, request: pytest.FixtureRequest, tmp_path: Path) -> None:
    """Compares what a tab shows with what is kept of a page."""
    outline: list[str] = tab.page.evaluate(OUTLINE)
    outline_file = FOLDER / f"{page}.txt"
    if request.config.getoption("--golden"):
        outline_file.write_text("".join(f"{line}\n" for line in outline), encoding="utf-8")
    found = changes(outline, outline_file.read_text(encoding="utf-8").splitlines())
    assert found == [], "\n".join(found[:TOLD])
    if (page, tab.page.viewport_size["width"]) in LOOKED_AT:
        _check_picture(page, tab, chromium, request, tmp_path)
    assert tab.audit() == []
    assert tab.faults == []


def _check_picture(page: str, tab: Tab, chromium: Any, request: pytest.FixtureRequest, tmp_path: Path) -> None:
    picture = _screenshot(tab)
    golden_file = FOLDER / f"{page}-{tab.page.viewport_size['width']}-{tab.scheme}.png"
    if request.config.getoption("--golden"):
        _reduced(picture, _palette(picture)).save(golden_file, optimize=True)
        MADE_WITH.write_text(json.dumps(_made_with(chromium), indent=1) + "\n", encoding="utf-8")
    with Image.open(golden_file) as image:
        golden, seen = np.asarray(image.convert("RGB")), np.asarray(_reduced(picture, image).convert("RGB"))
    is_same = json.loads(MADE_WITH.read_text(encoding="utf-8")) == _made_with(chromium)
    apart = difference(seen, golden, NEAR if is_same else FAR)
    if apart:
        Image.fromarray(picture).save(tmp_path / golden_file.name)
    higher = abs(len(picture) - len(golden)) / len(golden)
    assert higher <= (0.0 if is_same else HEIGHT), f"see {tmp_path}"
    assert apart <= (SAME if is_same else OTHER), f"see {tmp_path}"


def test_what_is_missing_is_named(chromium: Any, url: str, api: Api, shown: Shown) -> None:
    """Whatever the browser: a chart, a row, a control or a picture less, or one that is not seen."""
    tab = Tab(chromium, url, 1280, "light")
    tab.sign_in(api.secrets["admin"])
    for page, change, said in (
        ("model", ".chart svg", "missing: svg"),
        ("model", "table tbody tr", "missing: "),
        ("model", ".chart .mark", "missing: svg"),
        ("scene", ".pictures img", "missing: img"),
        ("jobs", "select", "missing: select"),
        ("job", ".node", "missing: h3"),
    ):
        for how in ("remove()", "style.visibility = 'hidden'"):
            if change.endswith(".mark") and how != "remove()":
                continue  # marks are counted, seen or not
            _open(tab, _place(page, shown))
            golden: list[str] = tab.page.evaluate(OUTLINE)
            assert changes(golden, golden) == []
            tab.page.evaluate(f"() => {{ document.querySelector('main').querySelector('{change}').{how}; }}")
            assert any(one.startswith(said) for one in changes(tab.page.evaluate(OUTLINE), golden)), (page, change)
    assert tab.faults == []
    tab.context.close()


def test_a_difference_is_seen() -> None:
    """A word more, a colour of a control, a row less: each is beyond what the same browser may differ by."""
    golden = np.full((1200, 1280, 3), 255, dtype=np.uint8)
    changed = golden.copy()
    changed[100:112, 100:140] = 0  # a short word, of which half would be ink
    changed[100:112, 100:140:2] = 255
    assert difference(golden, golden, NEAR) == 0.0
    assert difference(changed, golden, NEAR) > SAME
    assert difference(changed[:-1], golden, FAR) < OTHER


def difference(picture: NDArray[np.uint8], golden: NDArray[np.uint8], step: int) -> float:
    """Share of the pixels of the rows that two pictures share of which a channel differs by more than a step."""
    rows = min(len(picture), len(golden))
    apart = np.abs(picture[:rows].astype(np.int16) - golden[:rows].astype(np.int16)).max(axis=2)
    return float((apart > step).mean())


def changes(outline: list[str], golden: list[str]) -> list[str]:
    """What a page lacks, or has more, than a golden one."""
    found: list[str] = []
    for change, i, j, m, n in SequenceMatcher(None, golden, outline, autojunk=False).get_opcodes():
        if change != "equal":
            found += [f"missing: {line}" for line in golden[i:j]]
            found += [f"added: {line}" for line in outline[m:n]]
    return found


def _place(page: str, shown: Shown) -> str:
    places = {"overview": "/", "job": f"/jobs/{shown.running}", "model": "/models/glass"}
    return places.get(page, f"/scenes/{shown.scene}" if page == "scene" else f"/{page}")


def _open(tab: Tab, place: str) -> None:
    """Opens a page, and waits until all its pictures are there."""
    tab.page.goto(place, wait_until="load")
    tab.page.evaluate(
        "Promise.all([document.fonts.ready, ...[...document.images].filter((one) => one.src).map((one) => {"
        " one.loading = 'eager'; return one.decode(); })])"
    )
    tab.settle()


def _screenshot(tab: Tab) -> NDArray[np.uint8]:
    """The whole page, uint8 [H, W, 3] of sRGB."""
    content = tab.page.screenshot(full_page=True, animations="disabled")
    with Image.open(io.BytesIO(content)) as image:
        return np.asarray(image.convert("RGB"))


def _palette(picture: NDArray[np.uint8]) -> Image.Image:
    """Half of the colours are the most frequent ones of a picture, the others cover the rest."""
    image = Image.fromarray(picture)
    packed = picture.astype(np.uint32) @ np.array([1 << 16, 1 << 8, 1], dtype=np.uint32)
    colours, counts = np.unique(packed, return_counts=True)
    found = colours[np.argsort(-counts, kind="stable")[: COLOURS // 2]]
    frequent = np.stack([found >> 16, found >> 8 & 255, found & 255], axis=-1)
    rest = image.quantize(COLOURS // 2, method=Image.Quantize.MAXCOVERAGE).getpalette() or []
    made = Image.new("P", (1, 1))
    made.putpalette([*frequent.ravel().tolist(), *rest])
    return made


def _reduced(picture: NDArray[np.uint8], palette: Image.Image) -> Image.Image:
    """A picture in the colours of another one."""
    return Image.fromarray(picture).quantize(palette=palette, dither=Image.Dither.NONE)


def _made_with(chromium: Any) -> dict[str, str]:
    fonts = {path.name: hashlib.sha256(path.read_bytes()).hexdigest()[:16] for path in font_files()}
    return {"chromium": chromium.version, **fonts}
