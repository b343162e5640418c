"""Pictures in the page: they decode to what was given, and heat maps mean what their bars say."""

from __future__ import annotations

import base64
import io

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image
from support.measured import picture_set

from evaluation.report import colours, pictures


def decode(uri: str) -> NDArray[np.uint8]:
    head, _, payload = uri.partition(",")
    assert head == "data:image/webp;base64"
    return np.asarray(Image.open(io.BytesIO(base64.b64decode(payload))).convert("RGB"))


def test_a_data_uri_decodes_to_about_the_same_picture() -> None:
    ramp = np.repeat(np.arange(0, 256, 4, dtype=np.uint8)[None, :, None], 48, axis=0).repeat(3, axis=2)
    decoded = decode(pictures.data_uri(ramp, 90))
    assert decoded.shape == ramp.shape
    assert np.abs(decoded.astype(int) - ramp.astype(int)).max() <= 8


@pytest.mark.parametrize("anchors", [colours.HEAT, colours.COUNT])
def test_colour_maps_go_through_their_anchors_and_clamp(anchors: colours.Anchors) -> None:
    ends = colours.apply(np.array([-1.0, 0.0, 1.0, 2.0, np.nan]), anchors)
    assert ends.tolist() == [list(anchors[i]) for i in (0, 0, -1, -1, 0)]
    brightness = colours.apply(np.linspace(0, 1, len(anchors)), anchors).astype(int) @ np.array([2126, 7152, 722])
    assert (np.diff(brightness) > 0).all()


def test_squared_error_is_the_mean_over_rgb_of_display_values() -> None:
    exact = np.zeros((1, 2, 3), dtype=np.uint8)
    image = np.array([[[255, 0, 0], [51, 51, 51]]], dtype=np.uint8)
    assert pictures.squared_error(image, exact).tolist() == [[pytest.approx(1 / 3), pytest.approx(0.04)]]


def test_a_plate_has_the_exact_picture_first_and_techniques_in_order() -> None:
    (plate,) = pictures.plates([picture_set()])
    assert plate.columns == ["exact", "fixed k (kbuffer)", "bundle (kbuffer-deep)", "weighted-average"]
    assert [strip.title.split(" ")[0] for strip in plate.strips] == ["Picture", "Squared", "FLIP", "Core"]
    assert all(len(strip.cells) == 4 for strip in plate.strips)


def test_the_count_strip_has_a_hole_where_a_technique_has_no_counts() -> None:
    (plate,) = pictures.plates([picture_set()])
    counts = plate.strips[3].cells
    assert [cell is None for cell in counts] == [True, False, False, True]
    assert counts[1] is not None
    assert counts[1].caption == "0 to 8"


def test_captions_say_the_means() -> None:
    given = picture_set()
    (plate,) = pictures.plates([given])
    error, flip = plate.strips[1].cells[1], plate.strips[2].cells[1]
    assert error is not None
    assert flip is not None
    mse = pictures.squared_error(given.techniques["kbuffer"].image, given.exact).mean()
    assert error.caption == f"mean {mse * 1e5:.3g}e-5"
    assert flip.caption == f"mean {given.techniques['kbuffer'].flip.mean():.3g}"
