"""Thousands of fragments in one pixel, at the ends of what alpha and depth can be: every technique stays finite, the
exact ones stay exact, and the ones with a budget stay what the float64 simulation of the same allocation gives."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import moderngl
import numpy as np
import pytest
from support.training import export_random, random_weights

from evaluation.stress.gl_stacks import STRIDE, VIEW, extreme_stacks, size, stack_scene
from labeller.curves import composite
from renderer.allocation.cuts import FULL, MOST_CORE, usable_counts
from renderer.capture import capture
from renderer.features import FEATURES, derive, gather
from renderer.frame import Frame
from renderer.gpu_scene import GpuScene
from renderer.reference import adaptive, multilayer
from renderer.techniques import TECHNIQUES, Adaptive, Budget, Multilayer, Needs, Rendered, technique
from renderer.techniques.ordered import capture_ordered
from schemas.fragments import FragmentDump
from schemas.tail import BINNED_TAILS, DEFAULT_TAIL, TAILS, TailName

LAYERS = 4096
FEWER_LAYERS = 96
PREDICTED = ("kbuffer-deep", "kbuffer-temporal")
PASSES_GROW_WITH_LAYERS = ("depth-peeling", "dual-depth-peeling")
BOUND = 1e-5
"""Linear. 1 - 1/255 is rounded once and multiplied hundreds of times before the product is small: 4e-6 is usual."""


@dataclass(frozen=True)
class Case:
    """A frame of stacks, its fragments and the exact picture."""

    frame: Frame
    dump: FragmentDump

    def picture(self, k: np.ndarray, tail: TailName = "density") -> np.ndarray:
        return composite(self.dump, k, tail).reshape(self.dump.height, self.dump.width, 3)


def make_case(gl: moderngl.Context, layers: int) -> Case:
    stacks = extreme_stacks(layers)
    frame = Frame(GpuScene(gl, stack_scene(stacks)), VIEW, *size(len(stacks)), float_sums=True)
    return Case(frame, capture(frame).dump)


@pytest.fixture(scope="module")
def case(gl: moderngl.Context) -> Case:
    return make_case(gl, LAYERS)


@pytest.fixture(scope="module")
def lower_case(gl: moderngl.Context) -> Case:
    return make_case(gl, FEWER_LAYERS)


@pytest.fixture(scope="module")
def needs(case: Case, tmp_path_factory: pytest.TempPathFactory) -> Needs:
    return Needs(
        bundle=make_bundle(case.dump, tmp_path_factory.mktemp("bundle")),
        allocate=lambda frame, _: np.minimum(frame.count(), 5 + np.arange(frame.pixels) % 60).astype(np.int32),
    )


def make_bundle(dump: FragmentDump, folder: Path, tail: TailName = DEFAULT_TAIL) -> Path:
    network = random_weights(11, FEATURES, (8,), tail=tail)
    export_random(folder, network, derive(gather(dump, tail))[dump.counts > 0], tail)
    return folder


def family(name: str) -> list[str]:
    return [each for each, entry in TECHNIQUES.items() if entry.family == name]


def render(case: Case, name: str, needs: Needs, tail: TailName = "density") -> Rendered:
    rendered = technique(name, needs).render(case.frame, Budget(case.dump.total // 64, tail))
    assert np.isfinite(rendered.linear).all()
    assert rendered.linear.min() >= 0.0
    return rendered


def test_every_layer_is_captured_in_order(case: Case) -> None:
    counts = case.dump.counts
    assert set(np.unique(counts)) == {0, LAYERS}
    assert (counts > 0).sum() == 4 * len(extreme_stacks(1))
    depth = case.dump.depth.reshape(-1, LAYERS)
    assert (np.diff(depth, axis=1) >= 0.0).all()
    assert case.dump.depth.max() > 4000.0 * case.dump.depth.min()


@pytest.mark.parametrize("name", family("exact"))
def test_exact_techniques_stay_exact__name(case: Case, lower_case: Case, needs: Needs, name: str) -> None:
    used = lower_case if name in PASSES_GROW_WITH_LAYERS else case
    rendered = render(used, name, needs)
    np.testing.assert_allclose(rendered.linear, used.picture(used.dump.counts), atol=BOUND, rtol=0)


@pytest.mark.parametrize("tail", TAILS)
@pytest.mark.parametrize("name", [name for name in family("bounded") if name not in PREDICTED])
def test_bounded_techniques_are_as_simulated__name_tail(case: Case, needs: Needs, name: str, tail: TailName) -> None:
    rendered = render(case, name, needs, tail)
    assert 0 < rendered.captured < case.dump.total
    np.testing.assert_allclose(rendered.linear, case.picture(rendered.k, tail), atol=BOUND, rtol=0)


@pytest.mark.parametrize("layers", [FEWER_LAYERS, 300, 1500, LAYERS])
@pytest.mark.parametrize("tail", BINNED_TAILS)
@pytest.mark.parametrize("name", PREDICTED)
def test_predicted_cores_are_bins_of_fewer_than_255_and_1023_in_all__name_tail_layers(
    gl: moderngl.Context, tmp_path: Path, name: str, tail: TailName, layers: int
) -> None:
    """Thousands of fragments in every bin leave a pixel to its tail, and the picture is as simulated all the same."""
    case = make_case(gl, layers)
    needs = Needs(bundle=make_bundle(case.dump, tmp_path, tail))
    by_bin = case.frame.kept_bins(tail).counts()
    usable = usable_counts(by_bin)
    assert (by_bin == FULL).any() == (layers > FEWER_LAYERS)
    for fragments in (0, int(usable.sum()) // 3, case.dump.total - 1, 2 * case.dump.total):
        rendered = technique(name, needs).render(case.frame, Budget(fragments, tail))
        assert rendered.captured <= min(fragments, int(usable.sum()))
        assert rendered.captured == usable.sum() or fragments < usable.sum()
        assert rendered.k.max() <= MOST_CORE
        np.testing.assert_allclose(rendered.linear, case.picture(rendered.k, tail), atol=BOUND, rtol=0)


@pytest.mark.parametrize("name", family("approximate"))
def test_approximate_techniques_make_no_light__name(case: Case, needs: Needs, name: str) -> None:
    # No surface and no background is brighter than 1.
    assert render(case, name, needs).linear.max() <= 1.0 + BOUND


@pytest.mark.parametrize("nodes", [8, 16])
@pytest.mark.parametrize("name", [Multilayer.name, Adaptive.name])
def test_ordered_techniques_equal_their_twins__name_nodes(case: Case, name: str, nodes: int) -> None:
    # The most nodes: a loop over them that is not unrolled would end too early here (`renderer.screen.TURNS`).
    twin = {Multilayer.name: multilayer, Adaptive.name: adaptive}[name]
    found = capture_ordered(case.frame)
    linear = render(case, name, Needs(nodes=nodes)).linear.reshape(-1, 3)
    for stack in range(len(extreme_stacks(1))):
        pixel = STRIDE * stack + STRIDE // 2 + (STRIDE // 2) * case.frame.width
        run = slice(found.offsets[pixel], found.offsets[pixel + 1])
        background = case.dump.background[pixel : pixel + 1]
        expected = twin.picture(np.array([0, LAYERS]), found.packed[run], found.depth[run], background, nodes)
        np.testing.assert_allclose(linear[pixel], expected[0], atol=BOUND, rtol=0)
