"""Textures of the sample scenes: float64 [h, w, 4] in [0,1], sRGB-encoded colour, linear alpha, row 0 at the top."""

from __future__ import annotations

import numpy as np

from renderer.samples.shapes import Floats


def _canvas(size: tuple[int, int]) -> tuple[Floats, Floats]:
    """T and s of each pixel's centre, t = 1 in the top row."""
    h, w = size
    t, s = np.meshgrid(1.0 - (np.arange(h) + 0.5) / h, (np.arange(w) + 0.5) / w, indexing="ij")
    return t, s


def _noise(size: tuple[int, int], cells: int, rng: np.random.Generator) -> Floats:
    """Smooth noise in [0,1]: three octaves of bilinear lattices."""
    t, s = _canvas(size)
    total = np.zeros(size)
    for octave in range(3):
        n = cells * 2**octave
        lattice = rng.uniform(0.0, 1.0, (n + 2, n + 2))
        y, x = t * n, s * n
        i, j = y.astype(int), x.astype(int)
        v, u = y - i, x - j
        v, u = v * v * (3 - 2 * v), u * u * (3 - 2 * u)
        low = lattice[i, j] * (1 - u) + lattice[i, j + 1] * u
        high = lattice[i + 1, j] * (1 - u) + lattice[i + 1, j + 1] * u
        total += (low * (1 - v) + high * v) * 0.5 ** (octave + 1)
    return total / 0.875


def leaf(colour: tuple[float, float, float], alpha: float, seed: int) -> Floats:
    """One leaf, tip at the top, with veins."""
    t, s = _canvas((128, 96))
    half = 0.46 * np.sin(np.pi * t**0.8) ** 0.8
    across = np.abs(s - 0.5) / np.maximum(half, 1e-6)
    edge = np.clip((1.0 - across) * half * 60.0, 0.0, 1.0)
    vein = np.exp(-(((s - 0.5) / 0.015) ** 2)) + 0.6 * np.exp(
        -((np.sin(22.0 * (t - 0.7 * np.abs(s - 0.5))) / 0.25) ** 2)
    )
    shade = 0.75 + 0.5 * _noise((128, 96), 4, np.random.default_rng(seed)) - 0.18 * np.clip(vein, 0, 1)
    rgb = np.array(colour) * shade[..., None]
    return np.concatenate((np.clip(rgb, 0, 1), (alpha * edge)[..., None]), axis=2)


def strands(colour: tuple[float, float, float], seed: int) -> Floats:
    """A lock of hair: vertical streaks that thin out to the sides and towards the tip (bottom)."""
    rng = np.random.default_rng(seed)
    t, s = _canvas((256, 64))
    streak = np.repeat(rng.uniform(0.0, 1.0, 64)[None], 256, axis=0)
    streak = 0.5 * streak + 0.25 * (np.roll(streak, 1, 1) + np.roll(streak, -1, 1))
    side = np.clip(1.0 - np.abs(2.0 * s - 1.0) ** 3, 0.0, 1.0)
    tip = np.clip((t - 0.35 * (1.0 - streak)) * 5.0, 0.0, 1.0)
    alpha = np.clip(1.5 * streak - 0.25, 0.0, 0.9) * side * tip
    rgb = np.array(colour) * (0.7 + 0.6 * streak)[..., None]
    return np.concatenate((np.clip(rgb, 0, 1), alpha[..., None]), axis=2)


def puff(shade: tuple[float, float, float], seed: int) -> Floats:
    """A puff of smoke: soft noise in a disc."""
    size = (128, 128)
    t, s = _canvas(size)
    noise = _noise(size, 4, np.random.default_rng(seed))
    radius = 2.0 * np.hypot(t - 0.5, s - 0.5)
    alpha = np.clip(1.0 - radius, 0.0, 1.0) ** 0.7 * np.clip(1.9 * noise - 0.35, 0.0, 1.0)
    rgb = np.array(shade) * (0.75 + 0.4 * noise)[..., None]
    return np.concatenate((np.clip(rgb, 0, 1), (0.55 * alpha)[..., None]), axis=2)


def lace(colour: tuple[float, float, float]) -> Floats:
    """Woven cloth with a pattern of dots: never fully transparent, never opaque."""
    t, s = _canvas((256, 256))
    weave = 0.5 + 0.25 * np.sin(2 * np.pi * 64 * s) + 0.25 * np.sin(2 * np.pi * 64 * t)
    dots = np.clip(3.0 * (np.sin(2 * np.pi * 6 * s) * np.sin(2 * np.pi * 6 * t)) - 1.0, 0.0, 1.0)
    alpha = 0.14 + 0.14 * weave + 0.45 * dots
    rgb = np.array(colour) * (0.85 + 0.15 * dots)[..., None]
    return np.concatenate((np.clip(rgb, 0, 1), alpha[..., None]), axis=2)


def glow(alpha: float) -> Floats:
    """A white spot whose opacity falls off from `alpha` in the middle to nothing at the rim."""
    t, s = _canvas((64, 64))
    fall = np.clip(1.0 - 2.0 * np.hypot(t - 0.5, s - 0.5), 0.0, 1.0)
    return np.concatenate((np.ones((64, 64, 3)), (alpha * fall**1.6)[..., None]), axis=2)
