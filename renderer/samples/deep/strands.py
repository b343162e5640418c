"""Deep sample scenes of curves: a furry bear, a head of long hair."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from renderer.samples.author import Colour, StageAuthor
from renderer.samples.cards import bust
from renderer.samples.shapes import Floats, directions, disc, sphere, unit

_DOWN = np.array([0.0, -1.0, 0.0])

# Of the bear, metres: centre, radii, strands, length of the fur, colour of the fur.
_BROWN, _PALE = (0.42, 0.23, 0.10), (0.72, 0.50, 0.28)
_BODY: tuple[tuple[tuple[float, float, float], tuple[float, float, float], int, float, Colour], ...] = (
    ((0.0, 0.30, 0.0), (0.22, 0.28, 0.19), 12000, 0.085, _BROWN),
    ((0.0, 0.28, 0.07), (0.14, 0.18, 0.15), 4500, 0.068, _PALE),
    ((0.0, 0.69, 0.02), (0.17, 0.155, 0.155), 9500, 0.068, _BROWN),
    ((0.0, 0.64, 0.15), (0.075, 0.06, 0.07), 2400, 0.030, _PALE),
    ((-0.14, 0.83, 0.0), (0.06, 0.06, 0.03), 2000, 0.040, _BROWN),
    ((0.14, 0.83, 0.0), (0.06, 0.06, 0.03), 2000, 0.040, _BROWN),
    ((-0.24, 0.40, 0.08), (0.075, 0.17, 0.085), 4000, 0.068, _BROWN),
    ((0.24, 0.40, 0.08), (0.075, 0.17, 0.085), 4000, 0.068, _BROWN),
    ((-0.16, 0.10, 0.22), (0.095, 0.09, 0.17), 4000, 0.062, _BROWN),
    ((0.16, 0.10, 0.22), (0.095, 0.09, 0.17), 4000, 0.062, _BROWN),
)


def fur(folder: Path) -> Path:
    """A sitting bear cub whose fur is 48,000 translucent curves that thin out towards their tips."""
    author = StageAuthor(folder / "fur.usdc")
    rng = np.random.default_rng(41)
    author.mesh("Ground", disc(1.1, 0.05), author.material("Ground", (0.36, 0.42, 0.30)))
    dark = author.material("Dark", (0.03, 0.02, 0.02))
    strands, shades = [], []
    for number, (centre, radii, count, length, colour) in enumerate(_BODY):
        skin = author.material(f"Skin{number}", (0.3 * colour[0], 0.3 * colour[1], 0.3 * colour[2]))
        author.mesh(f"Body/Part{number}", sphere(1.0, 20, 32).moved(scale=radii, by=centre), skin)
        strands.append(_fur(np.array(centre), np.array(radii), count, length, rng))
        shades.append(np.array(colour) * rng.uniform(0.55, 1.45, (count, 1)))
    hairs, colours = np.concatenate(strands), np.clip(np.concatenate(shades), 0.0, 1.0)
    author.curves("Fur", hairs, rng.uniform(0.0026, 0.0044, len(hairs)), colours, np.array([0.75, 0.18]))
    for number, x in enumerate((-0.06, 0.06)):
        author.mesh(f"Body/Eye{number}", sphere(0.021, 12, 20).moved(by=(x, 0.725, 0.185)), dark)
    author.mesh("Body/Nose", sphere(1.0, 12, 20).moved(scale=(0.034, 0.024, 0.02), by=(0.0, 0.665, 0.236)), dark)
    author.camera("Portrait", (0.32, 0.80, 1.0), (0.0, 0.60, 0.03), 34.0)
    author.camera("Front", (0.42, 0.80, 1.62), (0.0, 0.43, 0.03), 36.0)
    author.camera("Side", (-1.62, 0.6, 0.40), (0.0, 0.42, 0.05), 36.0)
    return author.save()


def _fur(centre: Floats, radii: Floats, count: int, length: float, rng: np.random.Generator) -> Floats:
    """Bezier curves [count, 4, 3] that grow out of an ellipsoid, combed down and to the back."""
    on = directions(count, rng)
    root, out = centre + on * radii, unit(on / radii)
    comb = _DOWN * 0.55 + np.array([0.0, 0.0, -0.35])
    flow = unit(comb - out * (out @ comb)[:, None] + rng.normal(scale=0.16, size=(count, 3)))
    tall = (length * rng.uniform(0.6, 1.15, count))[:, None]
    curl = rng.normal(scale=0.12, size=(count, 2, 3))
    middle = root + tall * (0.34 * out + 0.10 * flow)
    bend = root + tall * (0.55 * out + 0.42 * flow + curl[:, 0])
    tip = root + tall * (0.62 * out + 0.80 * flow + curl[:, 1])
    return np.stack((root, middle, bend, tip), axis=1)


def long_hair(folder: Path) -> Path:
    """A head with 16,000 translucent hairs to below the shoulders, in wavy locks."""
    author = StageAuthor(folder / "long_hair.usdc")
    rng = np.random.default_rng(43)
    bust(author)
    locks, each = 400, 40
    for shade, colour in enumerate(((0.50, 0.24, 0.08), (0.66, 0.36, 0.14))):
        hairs = np.concatenate([_lock(each, rng) for _ in range(locks // 2)])
        count = len(hairs)
        tone = np.array(colour) * np.repeat(rng.uniform(0.7, 1.25, (locks // 2, 1)), each, axis=0)
        tone *= rng.uniform(0.85, 1.15, (count, 1))
        widths = rng.uniform(0.0008, 0.0013, count)
        author.curves(f"Hair/Shade{shade}", hairs, widths, np.clip(tone, 0, 1), np.array([0.6, 0.5, 0.4, 0.12]))
    author.camera("Side", (0.66, 0.06, 0.40), (0.0, -0.10, 0.0), 34.0)
    author.camera("Back", (-0.40, 0.10, -0.80), (0.0, -0.12, 0.0), 36.0)
    author.camera("Front", (0.22, 0.08, 0.86), (0.0, -0.11, 0.0), 36.0)
    return author.save()


def _lock(count: int, rng: np.random.Generator) -> Floats:
    """Hairs [count, 10, 3] that grow together from a place on the scalp, over the head and down in waves."""
    while True:
        out = unit(rng.normal(size=3))
        # The face looks along +z.
        if out[1] > -0.25 and not (out[2] > 0.35 and out[1] < 0.62):
            break
    on = unit(out + rng.normal(scale=0.10, size=(count, 3)))
    root = on * np.array([0.092, 0.122, 0.1])
    # Parted in the middle, and combed out of the face.
    away = unit(np.array([np.sign(out[0]) * (0.35 + abs(out[0])), 0.0, min(out[2], 0.25) - 0.25]))
    length = float(rng.uniform(0.30, 0.42)) * rng.uniform(0.9, 1.05, (count, 1, 1))
    phase, wave = float(rng.uniform(0.0, 6.3)), float(rng.uniform(0.004, 0.012))
    t = np.linspace(0.0, 1.0, 10)[None, :, None]
    reach = 0.05 + 0.05 * float(rng.uniform()) + np.maximum(out[1], 0.0) * 0.10
    over = on[:, None] * (0.020 * np.sin(np.minimum(2.0 * t, 1.0) * 0.5 * np.pi))
    path = root[:, None] + over + away * reach * np.minimum(2.2 * t, 1.0) ** 0.8 * (1.0 - 0.25 * t)
    path = path + _DOWN * length * np.maximum(t - 0.06, 0.0) ** 1.25
    side = np.cross(away, _DOWN)
    strand = rng.normal(scale=0.006, size=(count, 1, 3)) * (0.3 + t)
    return np.asarray(path + wave * t * (np.sin(11.0 * t + phase) * side + np.cos(9.0 * t + phase) * away) + strand)
