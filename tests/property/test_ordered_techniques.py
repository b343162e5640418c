"""What techniques that depend on the order of submission promise for any list of fragments, on their twins."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from renderer.reference import adaptive, bevy, multilayer, storm_rules
from schemas.colour import decode_gamma2

BACKGROUND = np.array([[200, 120, 40]], np.uint8)

Key = tuple[float, int]


class Twin(Protocol):
    def __call__(
        self,
        offsets: NDArray[np.int64],
        packed: NDArray[np.uint32],
        depth: NDArray[np.float32],
        background: NDArray[np.uint8],
        nodes: int,
    ) -> NDArray[np.float64]: ...


@dataclass(frozen=True)
class Fragments:
    """The fragments of one pixel in their order of arrival."""

    depth: NDArray[np.float32]
    packed: NDArray[np.uint32]

    @property
    def keys(self) -> list[Key]:
        return [(float(z), int(word)) for z, word in zip(self.depth, self.packed, strict=True)]

    @property
    def through(self) -> NDArray[np.float64]:
        return 1.0 - (self.packed >> np.uint32(24)) / 255.0

    @property
    def linear(self) -> NDArray[np.float64]:
        return decode_gamma2(self.packed.astype("<u4").view(np.uint8).reshape(-1, 4)[:, :3])

    def front_to_back(self) -> Fragments:
        order = np.lexsort((self.packed, self.depth))
        return Fragments(self.depth[order], self.packed[order])

    def backwards(self) -> Fragments:
        return Fragments(self.depth[::-1], self.packed[::-1])


@st.composite
def fragments(draw: st.DrawFn, least: int = 0, most: int = 14) -> Fragments:
    n = draw(st.integers(least, most))
    # Few depths, so that ties are usual; also far apart ones, as an area counts them.
    depths = st.sampled_from([0.5, 1.0, 1.25, 2.0, 2.0000002, 3.0, 40.0, 5e4])
    alpha = st.one_of(st.sampled_from([1, 128, 254]), st.integers(1, 254))
    depth = draw(st.lists(depths, min_size=n, max_size=n))
    colour = draw(st.lists(st.integers(0, 0xFFFFFF), min_size=n, max_size=n))
    opacity = draw(st.lists(alpha, min_size=n, max_size=n))
    packed = [rgb | a << 24 for rgb, a in zip(colour, opacity, strict=True)]
    return Fragments(np.array(depth, np.float32), np.array(packed, np.uint32))


def picture(twin: Twin, pixel: Fragments, nodes: int) -> NDArray[np.float64]:
    return twin(np.array([0, len(pixel.packed)]), pixel.packed, pixel.depth, BACKGROUND, nodes)[0]


def exact(pixel: Fragments) -> NDArray[np.float64]:
    colour, transmittance = np.zeros(3), 1.0
    ordered = pixel.front_to_back()
    for through, linear in zip(ordered.through, ordered.linear, strict=True):
        colour = colour + transmittance * (1.0 - through) * linear
        transmittance *= through
    return colour + transmittance * decode_gamma2(BACKGROUND)[0]


@pytest.mark.parametrize("twin", [multilayer.picture, adaptive.picture], ids=["multilayer", "adaptive"])
@given(pixel=fragments(most=8))
def test_as_many_nodes_as_fragments_are_exact_in_any_order(twin: Twin, pixel: Fragments) -> None:
    nodes = max(2, len(pixel.packed))
    np.testing.assert_allclose(picture(twin, pixel, nodes), exact(pixel), atol=1e-12)


@given(pixel=fragments(), nodes=st.integers(1, 9))
def test_layers_keep_the_total_transmittance(pixel: Fragments, nodes: int) -> None:
    kept = multilayer.layers(pixel.packed, pixel.depth, nodes)
    assert len(kept) == min(nodes, len(pixel.packed))
    np.testing.assert_allclose(np.prod([through for _, _, through in kept]), np.prod(pixel.through), rtol=1e-12)


@given(pixel=fragments(), nodes=st.integers(1, 9))
def test_layers_but_the_last_are_the_nearest_fragments(pixel: Fragments, nodes: int) -> None:
    kept = multilayer.layers(pixel.packed, pixel.depth, nodes)
    assert [key for key, _, _ in kept[: nodes - 1]] == sorted(pixel.keys)[: nodes - 1]


@given(pixel=fragments(), nodes=st.integers(1, 9), backwards=st.booleans())
def test_layers_are_exact_when_fragments_arrive_in_order_of_depth(
    pixel: Fragments, nodes: int, backwards: bool
) -> None:
    arriving = pixel.front_to_back().backwards() if backwards else pixel.front_to_back()
    np.testing.assert_allclose(picture(multilayer.picture, arriving, nodes), exact(pixel), atol=1e-12)


@given(pixel=fragments(), nodes=st.integers(1, 9))
def test_layers_mix_colours_and_make_no_new_ones(pixel: Fragments, nodes: int) -> None:
    colours = np.concatenate([pixel.linear, decode_gamma2(BACKGROUND)])
    made = picture(multilayer.picture, pixel, nodes)
    assert (made >= colours.min(axis=0) - 1e-12).all()
    assert (made <= colours.max(axis=0) + 1e-12).all()


@given(pixel=fragments(least=1), nodes=st.integers(2, 9))
def test_curve_keeps_its_ends_falls_and_is_never_above_the_exact_one(pixel: Fragments, nodes: int) -> None:
    curve = adaptive.curve(pixel.packed, pixel.depth, nodes)
    assert len(curve.keys) == min(nodes, len(pixel.packed))
    assert curve.keys[0][:2] == min(pixel.keys)
    assert curve.keys[-1][:2] == max(pixel.keys)
    assert (np.diff([1.0, *curve.trans]) < 0.0).all()
    np.testing.assert_allclose(curve.trans[-1], np.prod(pixel.through), rtol=1e-12)
    everything = adaptive.curve(pixel.packed, pixel.depth, len(pixel.packed))
    for i, key in enumerate(pixel.keys):
        assert curve.before((*key, i)) <= everything.before((*key, i)) * (1.0 + 1e-12)


@given(pixel=fragments(), nodes=st.integers(2, 9))
def test_adaptive_is_never_brighter_than_exact_and_darkens_no_light_that_is_not_covered(
    pixel: Fragments, nodes: int
) -> None:
    made = picture(adaptive.picture, pixel, nodes)
    assert (made <= exact(pixel) + 1e-12).all()
    assert (made >= np.prod(pixel.through) * decode_gamma2(BACKGROUND)[0] - 1e-12).all()


@given(pixel=fragments(least=3, most=12))
def test_the_inner_node_that_goes_takes_the_least_area(pixel: Fragments) -> None:
    everything = adaptive.curve(pixel.packed, pixel.depth, len(pixel.packed))
    depth = np.array([key[0] for key in everything.keys])
    area = np.diff(depth)[:-1] * -np.diff(everything.trans)[:-1]
    before = list(everything.keys)
    everything.remove_least()
    (gone,) = set(before) - set(everything.keys)
    # The choice is made in float32.
    assert area[before.index(gone) - 1] <= area.min() * (1.0 + 1e-5) + 1e-12


@given(pixel=fragments(most=20), nodes=st.integers(1, 9))
def test_storm_composites_its_last_fragments_and_no_other(pixel: Fragments, nodes: int) -> None:
    last = Fragments(pixel.depth[-nodes:], pixel.packed[-nodes:])
    untied = len(np.unique(last.depth)) == len(last.depth)
    if untied:
        np.testing.assert_allclose(picture(storm_rules.picture, pixel, nodes), exact(last), atol=1e-12)


@given(pixel=fragments(most=20), nodes=st.integers(1, 9))
def test_bevy_composites_every_fragment_once_and_the_farthest_in_order(pixel: Fragments, nodes: int) -> None:
    walked = pixel.keys[::-1]
    order = bevy.composited(walked, nodes)
    assert sorted(order) == sorted(word for _, word in walked)
    far = sorted(((z, -(word >> 24)) for z, word in walked))[-nodes:]
    depth_of: dict[int, set[tuple[float, int]]] = {}
    for z, word in walked:
        depth_of.setdefault(word, set()).add((z, -(word >> 24)))
    assert all(key in depth_of[word] for key, word in zip(far, order[-nodes:], strict=True))


@given(pixel=fragments(most=20), nodes=st.integers(1, 9))
def test_bevy_is_exact_when_fragments_arrive_from_back_to_front(pixel: Fragments, nodes: int) -> None:
    arriving = pixel.front_to_back().backwards()
    if len(np.unique(pixel.depth)) == len(pixel.depth):
        np.testing.assert_allclose(picture(bevy.picture, arriving, nodes), exact(pixel), atol=1e-12)
