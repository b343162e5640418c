"""The importance of VKB ("Variable k-buffer using importance maps", EG 2017, Eq. 3-6), as a baseline."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class VkbOptions:
    """Factors and constants of VKB; the defaults are the paper's.

    Attributes:
        depth: Whether the depth-complexity factor is used.
        periphery: Whether the distance from the centre of the picture is used.
        fresnel: Whether the angle of the nearest surface is used.
        floor: Importance of the depth factor at n = 0 (the paper's a, .25 to .5).
        limit: Number of fragments from which the depth factor is 1 (the paper's N_lim, 20 to 30).
        reach: Distance at which the periphery factor is 0, as a share of the half diagonal.
        power: Exponent of the periphery factor; 10 and more is steep.
        noise: Width of the uniform noise, 0 for none.
        seed: Seed of the noise.
    """

    depth: bool = True
    periphery: bool = True
    fresnel: bool = True
    floor: float = 0.25
    limit: int = 20
    reach: float = 1.1
    power: float = 3.0
    noise: float = 0.1
    seed: int = 0

    @classmethod
    def thesis(cls, seed: int = 0) -> VkbOptions:
        """The Ioannina thesis's variant: no Fresnel factor, and a periphery `1 - (|p - o| / diagonal)^d`."""
        return cls(fresnel=False, reach=2.0, seed=seed)


def vkb_importance(
    n: NDArray[np.integer],
    facing: NDArray[np.uint8],
    width: int,
    height: int,
    options: VkbOptions = VkbOptions(),
) -> NDArray[np.float32]:
    """Importance of every pixel: the product of the factors, plus noise, not below 0.

    `I_d = a + (1-a) min(1, n/N_lim)`; `I_p = 1 - (2|p-o| / (1.1 diagonal))^d`; `I_f = 1 - (1 - |n.e|)^5 / 2`;
    `I = max(0, I_d I_p I_f + .1 (xi - .5))`.

    Args:
        n: [P], fragments of each pixel.
        facing: uint8 [P], |n.e| * 255 of the nearest transparent fragment.
        width: Pixels per row.
        height: Rows.
        options: Factors and constants.

    Returns:
        float32 [P], >= 0; 0 where n = 0.
    """
    importance = np.ones(width * height)
    if options.depth:
        importance *= options.floor + (1.0 - options.floor) * np.minimum(1.0, np.asarray(n) / options.limit)
    if options.periphery:
        x, y = np.arange(width) + 0.5 - width / 2.0, np.arange(height) + 0.5 - height / 2.0
        distance = np.hypot(x[None, :], y[:, None]).ravel() / (0.5 * np.hypot(width, height))
        importance *= 1.0 - (distance / options.reach) ** options.power
    if options.fresnel:
        importance *= 1.0 - (1.0 - facing / 255.0) ** 5 / 2.0
    if options.noise > 0.0:
        importance += options.noise * (np.random.default_rng(options.seed).random(width * height) - 0.5)
    return np.where(np.asarray(n) > 0, np.maximum(importance, 0.0), 0.0).astype(np.float32)
