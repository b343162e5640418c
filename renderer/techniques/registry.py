"""Every technique by its name, and what each needs besides a frame and a budget."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from renderer.allocation.importance import VkbOptions
from renderer.techniques.abuffer_array import ABufferArray
from renderer.techniques.abuffer_list import ABufferList
from renderer.techniques.adaptive import Adaptive
from renderer.techniques.base import Technique
from renderer.techniques.bevy import Bevy
from renderer.techniques.binned import Binned
from renderer.techniques.depth_peeling import DepthPeeling
from renderer.techniques.dual_depth_peeling import DualDepthPeeling
from renderer.techniques.kbuffer import KBuffer
from renderer.techniques.kbuffer_deep import Inference, KBufferDeep
from renderer.techniques.kbuffer_dynamic import KBufferDynamic
from renderer.techniques.kbuffer_importance import KBufferImportance
from renderer.techniques.kbuffer_optimal import Allocate, KBufferOptimal
from renderer.techniques.kbuffer_temporal import SETTLED, KBufferTemporal
from renderer.techniques.moment import Moment
from renderer.techniques.multilayer import Multilayer
from renderer.techniques.sbuffer import SBuffer
from renderer.techniques.stochastic import Stochastic
from renderer.techniques.storm_rules import StormRules
from renderer.techniques.wavelet import Wavelet
from renderer.techniques.weighted_average import WeightedAverage
from renderer.techniques.weighted_blended import WeightedBlended
from schemas.problem import ExitCode, Problem

Family = Literal["exact", "bounded", "approximate"]


@dataclass(frozen=True, slots=True)
class Needs:
    """What some techniques need besides a frame and a budget.

    Attributes:
        bundle: Folder of a bundle (`kbuffer-deep`, `kbuffer-temporal`).
        allocate: The allocation to render (`kbuffer-optimal`); the labeller's, which the renderer does not know.
        vkb: Factors of `kbuffer-importance`.
        inference: How `kbuffer-deep` runs its network.
        nodes: Nodes a pixel of `multilayer` and `adaptive`; None: 4 and 8, as in their papers.
        samples: Samples a pixel of `stochastic`; None: 8.
    """

    bundle: Path | None = None
    allocate: Allocate | None = None
    vkb: VkbOptions = field(default_factory=VkbOptions)
    inference: Inference = "glsl"
    nodes: int | None = None
    samples: int | None = None


@dataclass(frozen=True, slots=True)
class Entry:
    """A technique as it is listed.

    Attributes:
        family: `exact`: every fragment in order; `bounded`: core fragments within a budget, and a tail;
            `approximate`: sums or a few nodes for each pixel, whatever the budget.
        about: One line for lists.
        make: Builds it.
        needs_bundle: Whether it runs a bundle's network.
        settles: Frames of a still camera after which its picture is what it is measured by; 1: every frame is by
            itself.
    """

    family: Family
    about: str
    make: Callable[[Needs], Technique]
    needs_bundle: bool = False
    settles: int = 1


def technique(name: str, needs: Needs = Needs()) -> Technique:
    """The technique of that name.

    Raises:
        Problem: There is none, or what it needs was not given.
    """
    if name not in TECHNIQUES:
        raise Problem(
            f"There is no technique '{name}'.", f"Choose one of: {', '.join(TECHNIQUES)}.", ExitCode.NOT_FOUND
        )
    return TECHNIQUES[name].make(needs)


def _deep(needs: Needs) -> Technique:
    return KBufferDeep(_bundle(KBufferDeep.name, needs), needs.inference)


def _temporal(needs: Needs) -> Technique:
    return KBufferTemporal(_bundle(KBufferTemporal.name, needs), needs.inference)


def _bundle(name: str, needs: Needs) -> Path:
    if needs.bundle is None:
        raise Problem(f"{name} needs a bundle.", "Name the folder of one with --bundle.")
    return needs.bundle


def _optimal(needs: Needs) -> Technique:
    if needs.allocate is None:
        raise Problem("kbuffer-optimal needs an allocation.", "Give one with `Needs(allocate=...)`.")
    return KBufferOptimal(needs.allocate)


TECHNIQUES: Mapping[str, Entry] = {
    ABufferList.name: Entry("exact", "a linked list a pixel", lambda _: ABufferList()),
    ABufferArray.name: Entry(
        "exact", "as many slots for every pixel as the fullest one needs", lambda _: ABufferArray()
    ),
    SBuffer.name: Entry("exact", "contiguous runs a pixel, sorted", lambda _: SBuffer()),
    DepthPeeling.name: Entry("exact", "one layer a geometry pass", lambda _: DepthPeeling()),
    DualDepthPeeling.name: Entry("exact", "nearest and farthest layer a geometry pass", lambda _: DualDepthPeeling()),
    KBuffer.name: Entry("bounded", "the same k for every pixel of the window", lambda _: KBuffer()),
    KBufferDynamic.name: Entry("bounded", "the largest k for all pixels that F holds", lambda _: KBufferDynamic()),
    KBufferImportance.name: Entry(
        "bounded", "k(p) by importance maps (VKB)", lambda needs: KBufferImportance(needs.vkb)
    ),
    KBufferDeep.name: Entry("bounded", "k(p) by a bundle's network", _deep, needs_bundle=True),
    KBufferTemporal.name: Entry(
        "bounded", "k(p) by a network and the last frame", _temporal, needs_bundle=True, settles=SETTLED
    ),
    KBufferOptimal.name: Entry("bounded", "k(p) as allocated with all fragments known", _optimal),
    Binned.name: Entry("approximate", "a mean weighted by what depth bins know to be in front", lambda _: Binned()),
    WeightedAverage.name: Entry("approximate", "mean colour, mean opacity", lambda _: WeightedAverage()),
    WeightedBlended.name: Entry("approximate", "mean weighted by depth (McGuire)", lambda _: WeightedBlended()),
    Moment.name: Entry("approximate", "transmittance from 4 power moments (Muenstermann)", lambda _: Moment()),
    Multilayer.name: Entry(
        "approximate",
        "a few layers; the farthest merge (MLAB)",
        lambda needs: Multilayer() if needs.nodes is None else Multilayer(needs.nodes),
    ),
    Adaptive.name: Entry(
        "approximate",
        "visibility in a few steps (Salvi)",
        lambda needs: Adaptive() if needs.nodes is None else Adaptive(needs.nodes),
    ),
    Stochastic.name: Entry(
        "approximate",
        "visibility from random depth samples (Enderton)",
        lambda needs: Stochastic() if needs.samples is None else Stochastic(needs.samples),
    ),
    Wavelet.name: Entry("approximate", "transmittance from 16 Haar coefficients (Aizenshtein)", lambda _: Wavelet()),
    Bevy.name: Entry("approximate", "Bevy's lists: 8 sorted, overflow lost", lambda _: Bevy()),
    StormRules.name: Entry("approximate", "Storm's lists: the last 8, overflow lost", lambda _: StormRules()),
}
"""Every technique, in the order in which lists show them."""
