"""Pictures of a benchmark: the spot of a view, and who is shown on it."""

from __future__ import annotations

import base64
import io
from pathlib import Path

import numpy as np
from PIL import Image

from evaluation.bench.album import SPOT, Album, sheet_of
from evaluation.bench.page import page
from schemas.bench import BenchCell, BenchView
from tests.unit.evaluation.bench.test_groups import cell, result, view

EXACT = np.full((200, 300, 3), 128, np.uint8)


def _off(rows: slice, columns: slice) -> np.ndarray:
    image = EXACT.copy()
    image[rows, columns] = 255
    return image


def _kept(out: Path, *shown: tuple[BenchCell, np.ndarray], key: str = "seen") -> BenchView:
    album = Album(out, key, EXACT)
    for one, image in shown:
        album.keep(one.key, image)
    return view(*(one for one, _ in shown), key=key)


def test_every_technique_is_shown_on_the_spot_where_the_first_one_that_errs_errs_most(tmp_path: Path) -> None:
    seen = _kept(
        tmp_path,
        (cell("sbuffer", mse=0.0), EXACT),
        (cell("kbuffer", 1.0, mse=1e-3), _off(slice(100, 110), slice(200, 210))),
        (cell("kbuffer-importance", 1.0, mse=1e-4), _off(slice(0, 50), slice(0, 50))),
        (cell("kbuffer", 2.0, mse=1e-5), EXACT),
        (cell("moment", mse=1e-2), _off(slice(0, 200), slice(0, 300))),
    )
    sheet = sheet_of(tmp_path, [seen])
    assert sheet is not None
    captions = [tile.caption.partition(":")[0] for tile in sheet.tiles[2:]]
    assert captions == ["fixed k (kbuffer)", "moment"]  # at F = 2 WH: the others have another budget, or no error
    exact, fixed, moment = (_decoded(tile.uri) for tile in sheet.tiles[1:])
    assert exact.shape == (*SPOT, 3)
    assert abs(fixed.astype(int) - 128).max() < 8
    assert moment.min() > 247
    first = _decoded_file(tmp_path, "kbuffer_binned-12_1.png")
    assert (first == 255).sum() == 10 * 10 * 3
    assert (_decoded_file(tmp_path, "kbuffer-importance_binned-12_1.png") == 128).all()


def test_the_page_shows_pictures_where_there_are_some(tmp_path: Path) -> None:
    seen = _kept(tmp_path, (cell("kbuffer", 1.0, mse=1e-3), _off(slice(100, 110), slice(200, 210))))
    made = result().model_copy(update={"views": (seen,)})
    assert page(made, [], None, tmp_path).count("<img") == 3
    assert "<img" not in page(made, [], None)
    assert sheet_of(tmp_path / "other", [seen]) is None


def test_a_run_that_goes_on_shows_the_same_spot(tmp_path: Path) -> None:
    one = cell("kbuffer", 1.0, mse=1e-3)
    _kept(tmp_path, (one, _off(slice(100, 110), slice(200, 210))))
    _kept(tmp_path, (cell("moment", mse=1e-3), _off(slice(0, 10), slice(0, 10))))
    assert (_decoded_file(tmp_path, "moment.png") == 128).all()


def test_a_picture_smaller_than_a_spot_is_shown_whole(tmp_path: Path) -> None:
    exact = EXACT[:20, :30]
    Album(tmp_path, "seen", exact).keep(cell("moment").key, 255 - exact)
    assert _decoded_file(tmp_path, "moment.png").shape == exact.shape


def _decoded(uri: str) -> np.ndarray:
    return np.asarray(Image.open(io.BytesIO(base64.b64decode(uri.partition(",")[2]))))


def _decoded_file(out: Path, name: str) -> np.ndarray:
    return np.asarray(Image.open(out / "pictures" / "seen" / name))
