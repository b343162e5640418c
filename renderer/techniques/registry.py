"""Every technique by its name; what each is and needs, its class says."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from renderer.techniques.abuffer_array import ABufferArray
from renderer.techniques.abuffer_list import ABufferList
from renderer.techniques.adaptive import Adaptive
from renderer.techniques.base import Needs, Technique
from renderer.techniques.bevy import Bevy
from renderer.techniques.binned import Binned
from renderer.techniques.depth_peeling import DepthPeeling
from renderer.techniques.dual_depth_peeling import DualDepthPeeling
from renderer.techniques.kbuffer import KBuffer
from renderer.techniques.kbuffer_deep import KBufferDeep
from renderer.techniques.kbuffer_dynamic import KBufferDynamic
from renderer.techniques.kbuffer_importance import KBufferImportance
from renderer.techniques.kbuffer_optimal import KBufferOptimal
from renderer.techniques.kbuffer_temporal import KBufferTemporal
from renderer.techniques.moment import Moment
from renderer.techniques.multilayer import Multilayer
from renderer.techniques.sbuffer import SBuffer
from renderer.techniques.stochastic import Stochastic
from renderer.techniques.storm_rules import StormRules
from renderer.techniques.wavelet import Wavelet
from renderer.techniques.weighted_average import WeightedAverage
from renderer.techniques.weighted_blended import WeightedBlended
from schemas.problem import ExitCode, Problem

TECHNIQUES: Final[Mapping[str, type[Technique]]] = {
    each.name: each
    for each in (
        ABufferList,
        ABufferArray,
        SBuffer,
        DepthPeeling,
        DualDepthPeeling,
        KBuffer,
        KBufferDynamic,
        KBufferImportance,
        KBufferDeep,
        KBufferTemporal,
        KBufferOptimal,
        Binned,
        WeightedAverage,
        WeightedBlended,
        Moment,
        Multilayer,
        Adaptive,
        Stochastic,
        Wavelet,
        Bevy,
        StormRules,
    )
}
"""Every technique, in the order in which lists show them."""


_NOTHING: Final = Needs()


def technique(name: str, needs: Needs = _NOTHING) -> Technique:
    """The technique of that name.

    Raises:
        Problem: There is none, or what it needs was not given.
    """
    if name not in TECHNIQUES:
        raise Problem(
            f"There is no technique '{name}'.", f"Choose one of: {', '.join(TECHNIQUES)}.", ExitCode.NOT_FOUND
        )
    return TECHNIQUES[name].of(needs)
