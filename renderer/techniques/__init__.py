"""The ways to render transparency, by name: the same names in shaders, tests, manifests and reports."""

from renderer.techniques.abuffer_array import ABufferArray
from renderer.techniques.abuffer_list import ABufferList
from renderer.techniques.adaptive import Adaptive
from renderer.techniques.base import Budget, Needs, Rendered, Technique, Twin
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
from renderer.techniques.registry import TECHNIQUES, technique
from renderer.techniques.sbuffer import SBuffer
from renderer.techniques.stochastic import Stochastic
from renderer.techniques.storm_rules import StormRules
from renderer.techniques.wavelet import Wavelet
from renderer.techniques.weighted_average import WeightedAverage
from renderer.techniques.weighted_blended import WeightedBlended

__all__ = [
    "TECHNIQUES",
    "ABufferArray",
    "ABufferList",
    "Adaptive",
    "Bevy",
    "Binned",
    "Budget",
    "DepthPeeling",
    "DualDepthPeeling",
    "KBuffer",
    "KBufferDeep",
    "KBufferDynamic",
    "KBufferImportance",
    "KBufferOptimal",
    "KBufferTemporal",
    "Moment",
    "Multilayer",
    "Needs",
    "Rendered",
    "SBuffer",
    "Stochastic",
    "StormRules",
    "Technique",
    "Twin",
    "Wavelet",
    "WeightedAverage",
    "WeightedBlended",
    "technique",
]
