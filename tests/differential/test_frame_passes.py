"""GL passes against the dump of the same frame."""

from __future__ import annotations

import moderngl
import numpy as np
import pytest
from support.scenes import SIZE, VIEW, shells

from renderer.capture import capture, row_bands
from renderer.csr import offsets_of
from renderer.features import gather
from renderer.frame import Frame
from renderer.gpu_scene import GpuScene
from schemas.fragments import FragmentDump


def test_dump_is_sorted_by_depth_then_colour_inside_every_pixel(dump: FragmentDump) -> None:
    keys = dump.depth.view(np.uint32).astype(np.uint64) << np.uint64(32) | dump.rgba.view("<u4").ravel()
    rising = keys[1:] >= keys[:-1]
    first = np.zeros(dump.total, dtype=bool)
    first[dump.offsets[:-1][dump.counts > 0]] = True
    assert (rising | first[1:]).all()
    assert dump.total > 10_000


def test_dump_holds_no_invisible_and_no_opaque_fragment(dump: FragmentDump) -> None:
    alpha = dump.rgba[:, 3]
    assert alpha.min() > 0
    assert alpha.max() < 255


def test_equal_depths_are_in_the_dump(dump: FragmentDump) -> None:
    ties = (dump.depth[1:] == dump.depth[:-1]).mean()
    assert ties > 0.3, "the scene has every sphere twice, else the ties below test nothing"


def test_dump_is_identical_from_frame_to_frame_and_for_any_bands(
    ctx: moderngl.Context, dump: FragmentDump, monkeypatch: pytest.MonkeyPatch
) -> None:
    again = capture(Frame(GpuScene(ctx, shells()), VIEW, *SIZE)).dump
    monkeypatch.setattr("renderer.capture._BYTES_A_BAND", 8 * 20_000)
    captured = capture(Frame(GpuScene(ctx, shells()), VIEW, *SIZE))
    assert captured.bands > 1
    for other in (again, captured.dump):
        for field in ("offsets", "rgba", "depth", "background", "facing"):
            assert np.array_equal(getattr(dump, field), getattr(other, field)), field


def test_row_bands_cover_every_fragment_once_within_capacity() -> None:
    counts = np.random.default_rng(1).integers(0, 9, 12 * 10)
    offsets = offsets_of(counts)
    bands = row_bands(offsets, 12, 130)
    sizes = [offsets[(row + rows) * 12] - offsets[row * 12] for row, rows in bands]
    assert sum(sizes) == offsets[-1]
    assert max(sizes) <= 130


def test_gathered_sums_equal_those_of_the_dump(frame: Frame, dump: FragmentDump) -> None:
    made = frame.gather("gather")
    texels = [np.frombuffer(t.read(), dtype=np.float32).reshape(-1, 4) for t in made.sums]
    expected = gather(dump)
    occupied = dump.counts > 0
    for index, texel in enumerate(texels):
        columns = 4 if index < 3 else 3
        np.testing.assert_allclose(
            texel[:, :columns][occupied], expected[occupied, 4 * index : 4 * index + columns], rtol=2e-5, atol=2e-5
        )
    _, z_min, z_max = frame.depth_range()
    for buffer, column in ((z_min, 15), (z_max, 19)):
        depth = np.frombuffer(buffer.read(), dtype=np.float32)[: dump.pixels]
        assert np.array_equal(depth[occupied], expected[occupied, column])
    assert made.nearest_colour is not None
    words = np.frombuffer(made.nearest_colour.read(), dtype=np.uint32)[: dump.pixels]
    assert np.array_equal(words[occupied], dump.rgba.view("<u4").ravel()[dump.offsets[:-1][occupied]])
