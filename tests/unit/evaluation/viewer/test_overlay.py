"""Text upon pictures: where it stands, and what it leaves alone."""

from __future__ import annotations

import numpy as np

from evaluation.report.colours import COUNT, apply
from evaluation.viewer.overlay import Note, draw, in_columns

GREY = np.full((120, 300, 3), 200, np.uint8)


def box(image: np.ndarray) -> tuple[int, int, int, int]:
    """First and last row and column that differ from the grey picture."""
    rows, columns = np.nonzero((image != GREY).any(axis=2))
    return int(rows.min()), int(rows.max()), int(columns.min()), int(columns.max())


def test_without_text_it_is_the_picture_itself() -> None:
    assert draw(GREY, []) is GREY


def test_text_stands_in_its_corner_and_part_and_the_picture_is_not_written_into() -> None:
    corners = {}
    for corner in ("top-left", "top-right", "bottom-left", "bottom-right", "middle"):
        corners[corner] = box(draw(GREY, [Note(["k 0..9", "MSE"], corner, 100, 200)]))  # type: ignore[arg-type]
    assert (GREY == 200).all()
    top, bottom, left, right = corners["top-left"]
    assert 0 < top < bottom < 60
    assert 100 < left < right < 200
    assert corners["top-right"][2:] == (399 - right, 399 - left)
    assert corners["bottom-left"][:2] == (119 - bottom, 119 - top)
    assert corners["bottom-right"] == (119 - bottom, 119 - top, 399 - right, 399 - left)
    assert abs(sum(corners["middle"][2:]) - 399) <= 1


def test_text_is_readable_on_any_picture() -> None:
    for level in (0, 255):
        image = draw(np.full_like(GREY, level), [Note(["MMMM"], "top-left", 0, 300)])
        assert image.max() == 255
        assert image[8, 8].max() < 100


def test_a_bar_has_all_its_colours() -> None:
    image = draw(GREY, [Note(["k"], "bottom-left", 0, 300, COUNT)])
    found = {tuple(pixel) for pixel in image.reshape(-1, 3).tolist()}
    assert {tuple(c) for c in apply(np.linspace(0.0, 1.0, 160), COUNT).tolist()} <= found


def test_what_is_too_large_is_cut_off() -> None:
    assert draw(GREY[:10, :10], [Note(["long " * 50] * 20, "middle", 0, 10, COUNT)]).shape == (10, 10, 3)


def test_text_does_not_reach_into_the_part_beside_its_own() -> None:
    long = Note(["M" * 60], "top-left", 0, 150)
    beside = Note(["I"], "top-left", 150, 150)
    assert box(draw(GREY, [long]))[3] == 149
    assert np.array_equal(draw(GREY, [long, beside])[:, 150:], draw(GREY, [beside])[:, 150:])


def test_a_later_note_is_readable_over_an_earlier_one() -> None:
    below, above = (Note([text], "top-left", 0, 300) for text in ("IIIIII", "MMMMMM"))
    alone, over = draw(GREY, [above]), draw(GREY, [below, above])
    assert np.array_equal((over == 255).all(axis=2), (alone == 255).all(axis=2))


def test_columns_are_aligned() -> None:
    image = draw(GREY, [Note(["M\tI", "MMMMMM\tI", "a line without columns, which is long"], "top-left", 0, 300)])
    white = (image == 255).all(axis=2)
    ends = [int(np.flatnonzero(white[12 + 17 * line : 25 + 17 * line].any(axis=0)).max()) for line in (0, 1)]
    assert ends[0] == ends[1]


def test_lines_that_do_not_fit_stand_side_by_side() -> None:
    lines = [f"{number}\tit" for number in range(7)]
    assert in_columns(lines, 1000) == lines
    packed = in_columns(lines, 80)
    assert packed == ["0\tit\t4\tit", "1\tit\t5\tit", "2\tit\t6\tit", "3\tit"]
    assert in_columns(lines, 1) == ["\t".join(lines)]
