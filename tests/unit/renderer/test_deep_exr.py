"""Deep OpenEXR against OpenEXR itself, and against OpenImageIO where it is installed."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from support.dumps import dump_of, random_dump

from labeller.reference import exact, pixel_of
from renderer.deep_exr import read_deep_exr, write_deep_exr
from schemas.colour import decode_gamma2
from schemas.fragments import FragmentDump
from schemas.problem import ExitCode, Problem

NONE = np.inf


def solid_behind(dump: FragmentDump, seed: int = 0) -> NDArray[np.float32]:
    """An opaque surface behind about half of the pixels; elsewhere the background is one colour."""
    rng = np.random.default_rng(seed)
    farthest = np.zeros(dump.pixels, np.float32)
    has = dump.counts > 0
    farthest[has] = dump.depth[dump.offsets[1:][has] - 1]
    depth = np.where(rng.random(dump.pixels) < 0.5, farthest + 1.0, NONE).astype(np.float32)
    dump.background[~np.isfinite(depth)] = (200, 100, 50)
    return depth


def same(a: FragmentDump, b: FragmentDump) -> bool:
    fields = ("offsets", "rgba", "depth", "background")
    return (a.width, a.height) == (b.width, b.height) and all(
        np.array_equal(getattr(a, name), getattr(b, name)) for name in fields
    )


@settings(max_examples=25)
@given(st.integers(1, 40), st.integers(1, 9), st.integers(0, 12), st.integers(0, 1000))
def test_a_dump_comes_back_as_it_was(width: int, height: int, most: int, seed: int) -> None:
    dump = random_dump(width, height, most, seed)
    depth = solid_behind(dump, seed)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.exr"
        write_deep_exr(path, dump, depth)
        assert same(read_deep_exr(path), dump)


def test_every_stored_colour_survives_every_alpha(tmp_path: Path) -> None:
    colours = np.arange(256, dtype=np.uint8)
    steps = np.arange(1, 257, dtype=np.float32)
    pixels = [(np.stack([colours, colours[::-1], colours, np.full(256, a)], axis=1), steps) for a in range(1, 255)]
    dump = dump_of(pixels)
    write_deep_exr(tmp_path / "a.exr", dump, np.full(dump.pixels, NONE, np.float32))
    assert same(read_deep_exr(tmp_path / "a.exr"), dump)


def test_openexr_reads_every_sample(tmp_path: Path) -> None:
    dump = random_dump(23, 7, 6, seed=3)
    depth = solid_behind(dump)
    matrix = np.arange(16, dtype=np.float32).reshape(4, 4)
    write_deep_exr(tmp_path / "a.exr", dump, depth, {"worldToCamera": matrix, "scene": "glass"})
    with OpenEXR.File(str(tmp_path / "a.exr"), separate_channels=True) as file:
        header = dict(file.header())
        channels = {name: channel.pixels for name, channel in file.channels().items()}
    assert header["type"] == OpenEXR.deepscanline
    assert header["compression"] == OpenEXR.ZIPS_COMPRESSION
    assert header["scene"] == "glass"
    assert np.array_equal(header["worldToCamera"], matrix)
    assert header["maxSamplesPerPixel"] == (dump.counts + np.isfinite(depth)).max()
    assert np.allclose(header["clearColor"], decode_gamma2(np.array([200, 100, 50], np.uint8)))
    for p in range(dump.pixels):
        y, x = divmod(p, dump.width)
        rows = slice(dump.offsets[p], dump.offsets[p + 1])
        alpha = dump.rgba[rows, 3:] / 255.0
        expected = np.concatenate((decode_gamma2(dump.rgba[rows, :3]) * alpha, alpha, dump.depth[rows, None]), axis=1)
        if np.isfinite(depth[p]):
            opaque = (*decode_gamma2(dump.background[p]), 1.0, depth[p])
            expected = np.concatenate((expected, [opaque]))
        got = [channels[name][y, x] for name in "RGBAZ"]
        assert [0 if samples is None else len(samples) for samples in got] == [len(expected)] * 5
        if len(expected):
            assert np.array_equal(np.stack(got[:4], axis=1), expected[:, :4].astype(np.float16))
            assert np.array_equal(got[4], expected[:, 4].astype(np.float32))


def test_samples_of_another_tool_are_put_in_order(tmp_path: Path) -> None:
    samples = {  # one pixel: out of order, one invisible, one behind the opaque one
        "Z": [3.0, 1.0, 2.0, 9.0, 4.0],
        "A": [1.0, 0.5, 0.0, 0.5, 0.25],
        "R": [0.25, 0.5, 0.7, 0.5, 0.1],
        "G": [0.0] * 5,
        "B": [1.0, 0.0, 0.0, 0.0, 0.0],
    }
    channels = {}
    for name, values in samples.items():
        cells = np.empty((2, 2), dtype=object)
        cells[1, 0] = np.array(values, dtype=np.float32)
        channels[name] = cells
    header = {"compression": OpenEXR.RLE_COMPRESSION, "type": OpenEXR.deepscanline}
    with OpenEXR.File(header, channels) as file:
        file.write(str(tmp_path / "a.exr"))
    dump = read_deep_exr(tmp_path / "a.exr")
    assert dump.counts.tolist() == [0, 0, 1, 0]
    assert dump.depth.tolist() == [1.0]
    assert dump.rgba.tolist() == [[255, 0, 0, 128]]
    assert dump.background.tolist() == [[0, 0, 0], [0, 0, 0], [128, 0, 255], [0, 0, 0]]
    assert dump.facing.tolist() == [0, 0, 255, 0]


def test_an_opaque_sample_is_never_in_front_of_a_fragment(tmp_path: Path) -> None:
    dump = dump_of([(np.array([[9, 9, 9, 90]], np.uint8), np.array([2.0], np.float32))])
    write_deep_exr(tmp_path / "a.exr", dump, np.array([1.9999], np.float32))
    assert same(read_deep_exr(tmp_path / "a.exr"), dump)


def test_openimageio_flattens_it_to_the_exact_picture(tmp_path: Path) -> None:
    oiio = pytest.importorskip("OpenImageIO")
    dump = random_dump(31, 17, 8, seed=5)
    depth = solid_behind(dump)
    write_deep_exr(tmp_path / "a.exr", dump, depth)
    flat = oiio.ImageBufAlgo.flatten(oiio.ImageBuf(str(tmp_path / "a.exr")))
    names = list(flat.spec().channelnames)
    pixels = flat.get_pixels(oiio.FLOAT).reshape(-1, len(names))
    rgb, alpha = (pixels[:, [names.index(name) for name in wanted]] for wanted in ("RGB", "A"))
    clear = decode_gamma2(np.array([200, 100, 50], np.uint8))
    picture = rgb + (1.0 - alpha) * clear
    expected = np.stack([exact(pixel_of(dump, p)) for p in range(dump.pixels)])
    # Half floats: eleven bits of every sample.
    assert np.abs(picture - expected).max() < 2.0**-10


@pytest.mark.parametrize(
    ("content", "words"), [(b"", "no OpenEXR file"), (b"v/1\x01\x02\x08\0\0channels", "no OpenEXR file")]
)
def test_what_is_no_openexr_is_said_so(tmp_path: Path, content: bytes, words: str) -> None:
    (tmp_path / "a.exr").write_bytes(content)
    with pytest.raises(Problem, match=words):
        read_deep_exr(tmp_path / "a.exr")


def test_a_flat_picture_and_a_missing_file_are_no_dumps(tmp_path: Path) -> None:
    with OpenEXR.File({}, {name: np.zeros((2, 2), np.float32) for name in "RGBAZ"}) as file:
        file.write(str(tmp_path / "flat.exr"))
    with pytest.raises(Problem, match="no deep samples"):
        read_deep_exr(tmp_path / "flat.exr")
    with pytest.raises(Problem) as caught:
        read_deep_exr(tmp_path / "missing.exr")
    assert caught.value.code == ExitCode.NOT_FOUND


def test_files_that_are_cut_short_or_damaged_are_problems(tmp_path: Path) -> None:
    rng = np.random.default_rng(5)
    dump = random_dump(4, 4, 6, seed=0)
    write_deep_exr(tmp_path / "a.exr", dump, solid_behind(dump))
    data = (tmp_path / "a.exr").read_bytes()
    for end in rng.integers(0, len(data), 12):
        (tmp_path / "cut.exr").write_bytes(data[:end])
        with pytest.raises(Problem, match="cut"):
            read_deep_exr(tmp_path / "cut.exr")
