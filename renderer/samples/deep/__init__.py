"""Sample scenes that budgets are for: 8 to 100 transparent fragments per pixel, their opacities as authored."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from renderer.samples.deep.anatomy import anatomy
from renderer.samples.deep.balls import fountain, marbles
from renderer.samples.deep.hedge import hedge
from renderer.samples.deep.puffs import cloudscape, galaxy, smoke_plume
from renderer.samples.deep.strands import fur, long_hair
from renderer.samples.deep.turbofan import turbofan

DEEP: dict[str, Callable[[Path], Path]] = {
    "anatomy": anatomy,
    "fur": fur,
    "fountain": fountain,
    "marbles": marbles,
    "hedge": hedge,
    "long_hair": long_hair,
    "turbofan": turbofan,
    "galaxy": galaxy,
    "smoke_plume": smoke_plume,
    "cloudscape": cloudscape,
}
"""Writers by name; each takes the folder and returns the stage's file."""
