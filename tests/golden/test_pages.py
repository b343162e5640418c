"""Pages of the dashboard as they look: light and dark, wide and narrow, over a service in which nothing is of chance.

With the browser and the fonts that the golden pictures were made with, hardly a pixel may differ. Others draw controls
and the edges of letters their own way (hinted letters: 1.5 % of the pixels of a page), but lay the page out alike:
there a changed colour or a missing row is not seen, only what breaks the page.

`python -m pytest tests/golden/test_pages.py --golden` writes them anew; look at them before they are committed.
"""

from __future__ import annotations

import hashlib
import io
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image
from support.api import Api
from support.browser import CHROMIUM, FONTS, Tab, browser, font_files
from support.dashboard import Shown, fill
from support.frozen import frozen

FOLDER = Path(__file__).parent / "pages"
MADE_WITH = FOLDER / "browser.json"

COLOURS = 64
"""Of a golden picture. The page is compared as its palette shows it, so that the same page is the same."""
ROWS = 1900
"""Of a page that is longer, the upper ones are compared."""
NEAR, FAR = 8, 96
"""Differences of a channel, of 255, up to which a pixel counts as the same: with the same browser, and with others."""
SAME, OTHER = 1e-5, 0.02
"""Share of pixels that may differ by more."""
HEIGHT = 0.01
"""Share of the height that another browser may add or leave out."""

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


@pytest.fixture(scope="module")
def chromium(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    pytest.importorskip("playwright.sync_api")
    if CHROMIUM is None:
        pytest.skip("chromium is not installed")
    if len(font_files()) < len(FONTS):
        pytest.skip("the DejaVu fonts are not installed")
    with browser(tmp_path_factory.mktemp("browser")) as started:
        yield started


@pytest.fixture(scope="module", params=[(w, s) for w in (1280, 360) for s in ("light", "dark")], ids=str)
def tab(request: pytest.FixtureRequest, chromium: Any, url: str, api: Api) -> Iterator[Tab]:
    opened = Tab(chromium, url, *request.param)
    opened.sign_in(api.secrets["admin"])
    yield opened
    opened.context.close()


@pytest.mark.parametrize("page", PAGES)
def test_page_looks_like_the_golden_one(
    page: str, tab: Tab, shown: Shown, chromium: Any, request: pytest.FixtureRequest, tmp_path: Path
) -> None:
    places = {"overview": "/", "job": f"/jobs/{shown.running}", "model": "/models/glass"}
    picture = _screenshot(tab, places.get(page, f"/scenes/{shown.scene}" if page == "scene" else f"/{page}"))
    golden_file = FOLDER / f"{page}-{tab.page.viewport_size['width']}-{tab.scheme}.png"
    if request.config.getoption("--golden"):
        _reduced(picture, _palette(picture)).save(golden_file, optimize=True)
        MADE_WITH.write_text(json.dumps(_made_with(chromium), indent=1) + "\n", encoding="utf-8")
    with Image.open(golden_file) as image:
        golden, seen = np.asarray(image.convert("RGB")), np.asarray(_reduced(picture, image).convert("RGB"))
    is_same = json.loads(MADE_WITH.read_text(encoding="utf-8")) == _made_with(chromium)
    found = difference(seen, golden, NEAR if is_same else FAR)
    if found:
        Image.fromarray(picture).save(tmp_path / golden_file.name)
    higher = abs(len(picture) - len(golden)) / len(golden)
    assert higher <= (0.0 if is_same else HEIGHT), f"see {tmp_path}"
    assert found <= (SAME if is_same else OTHER), f"see {tmp_path}"
    assert tab.faults == []


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


def _screenshot(tab: Tab, place: str) -> NDArray[np.uint8]:
    """A page from its top on, uint8 [H, W, 3] of sRGB, once all its pictures are there."""
    tab.page.goto(place, wait_until="load")
    tab.page.evaluate(
        "Promise.all([document.fonts.ready, ...[...document.images].map((one) => {"
        " one.loading = 'eager'; return one.decode(); })])"
    )
    content = tab.page.screenshot(full_page=True, animations="disabled")
    with Image.open(io.BytesIO(content)) as image:
        return np.asarray(image.convert("RGB"))[:ROWS]


def _palette(picture: NDArray[np.uint8]) -> Image.Image:
    """Half of the colours are the most frequent ones of a picture, the others cover the rest."""
    image = Image.fromarray(picture)
    colours, counts = np.unique(picture.reshape(-1, 3), axis=0, return_counts=True)
    frequent = colours[np.argsort(-counts, kind="stable")[: COLOURS // 2]]
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
