"""Deep sample scenes of soft cards: a volcano's plume, cumulus clouds, a spiral galaxy."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from renderer.samples.author import StageAuthor
from renderer.samples.images import glow, puff
from renderer.samples.shapes import Floats, directions, disc, lathe, rounded, sphere, sprites, unit


def smoke_plume(folder: Path) -> Path:
    """A volcano with a plume of 6,000 soft cards that billows up and drifts away."""
    author = StageAuthor(folder / "smoke_plume.usdc", metres=100.0)
    rng = np.random.default_rng(59)
    author.mesh("Sky", sphere(90.0, 20, 40), author.material("Sky", (0.60, 0.72, 0.86)))
    author.mesh("Land", disc(80.0, 0.2), author.material("Land", (0.24, 0.30, 0.16)))
    cone = rounded([(10.5, 0.0), (7.0, 1.1), (4.2, 2.9), (2.0, 5.2), (1.45, 5.5), (0.9, 4.9), (0.0, 4.7)], 8)
    author.mesh("Volcano", lathe(cone, 72), author.material("Rock", (0.27, 0.21, 0.18)))
    lava = author.material("Lava", (0.9, 0.25, 0.03), 1.0, (0.5, 0.1, 0.0))
    author.mesh("Crater", disc(1.05, 0.05).moved(by=(0.0, 5.05, 0.0)), lava)
    count = 6000
    rise = rng.uniform(0.0, 1.0, count) ** 0.75
    heart = np.column_stack((7.0 * rise**2.2, 5.0 + 11.5 * rise, 2.0 * rise**2))
    billow = np.sin(9.0 * rise + 1.0)[:, None] * np.array([0.5, 0.0, 0.4])
    radius = (0.75 + 3.6 * rise**1.1)[:, None]
    off = directions(count, rng) * rng.uniform(0.0, 1.0, (count, 1)) ** (1 / 2.2)
    at = heart + billow * radius * 0.6 + off * radius
    eye = (3.0, 6.5, 40.0)
    look = unit(unit(np.array(eye) - at) + 0.18 * rng.normal(size=(count, 3)))
    size = (1.0 + 3.0 * rise) * rng.uniform(0.7, 1.3, count)
    shade = 0.36 + 0.30 * rise[:, None] + 0.22 * off[:, 1:2] + rng.normal(scale=0.03, size=(count, 1))
    fire = np.exp(-9.0 * rise)[:, None] * np.array([0.45, 0.10, -0.10])
    colours = np.clip(shade * np.array([1.0, 0.96, 0.92]) + fire, 0.02, 0.95)
    normals = unit(off + 0.5 * look)
    for kind in range(3):
        soft = author.soft(f"Smoke{kind}", author.image(f"plume{kind}.png", puff((1.0, 1.0, 1.0), 60 + kind)))
        own = np.arange(count) % 3 == kind
        author.sprites(
            f"Plume/Kind{kind}", sprites(at[own], look[own], size[own], rng), normals[own], colours[own], soft
        )
    author.camera("Front", eye, (2.0, 10.2, 0.0), 32.0)
    author.camera("Side", (-26.0, 5.0, 28.0), (2.0, 8.0, 0.0), 28.0)
    author.camera("Near", (12.0, 9.0, 24.0), (3.0, 9.5, 0.5), 34.0)
    return author.save()


def cloudscape(folder: Path) -> Path:
    """Cumulus clouds over hills and a lake: 9,000 large soft cards."""
    author = StageAuthor(folder / "cloudscape.usdc", metres=100.0)
    rng = np.random.default_rng(61)
    author.mesh("Sky", sphere(120.0, 20, 40), author.material("Sky", (0.26, 0.50, 0.86)))
    author.mesh("Land/Plain", disc(110.0, 0.2), author.material("Plain", (0.26, 0.42, 0.16)))
    author.mesh(
        "Land/Lake",
        disc(9.0, 0.1).moved(scale=(1.8, 1, 1), by=(3, 0.12, 12)),
        author.material("Lake", (0.16, 0.34, 0.5)),
    )
    hill = author.material("Hill", (0.20, 0.34, 0.15))
    for number in range(14):
        x, z = -42.0 + 6.5 * number + float(rng.uniform(-2, 2)), float(rng.uniform(-36.0, -14.0))
        size = float(rng.uniform(5.0, 9.0))
        author.mesh(f"Land/Hill{number}", sphere(1.0, 14, 28).moved(scale=(size, 0.3 * size, size), by=(x, 0, z)), hill)
    at, normals, sizes = _cumulus(rng)
    eye = (0.0, 4.5, 40.0)
    look = unit(unit(np.array(eye) - at) + 0.12 * rng.normal(size=at.shape))
    lit = np.clip(0.80 + 0.45 * normals[:, 1:2] + rng.normal(scale=0.03, size=(len(at), 1)), 0.3, 1.0)
    colours = lit * np.array([1.0, 1.0, 1.0]) + (1.0 - lit) * np.array([0.10, 0.16, 0.28])
    for kind in range(3):
        image = puff((1.0, 1.0, 1.0), 70 + kind)
        image[..., 3] *= 0.42
        soft = author.soft(f"Cloud{kind}", author.image(f"cloud{kind}.png", image))
        own = np.arange(len(at)) % 3 == kind
        author.sprites(
            f"Clouds/Kind{kind}",
            sprites(at[own], look[own], sizes[own], rng),
            normals[own],
            np.clip(colours[own], 0, 1),
            soft,
        )
    author.camera("Front", eye, (0.0, 10.2, 0.0), 36.0)
    author.camera("Left", (-16.0, 3.0, 36.0), (2.0, 9.5, 0.0), 42.0)
    author.camera("Right", (18.0, 10.0, 34.0), (-2.0, 9.0, 0.0), 40.0)
    return author.save()


def _cumulus(rng: np.random.Generator) -> tuple[Floats, Floats, Floats]:
    """Centres, outward directions and sizes of the cards of seven clouds with flat bases."""
    at, normals, sizes = [], [], []
    for x, y, z, size in (
        (-13, 10.5, 0, 5.2),
        (1, 12.5, -5, 6.4),
        (14, 9.8, 2, 4.8),
        (-4, 7.2, 6, 3.0),
        (7.5, 15.5, -9, 5.0),
        (-20, 16.5, -9, 5.5),
        (20.5, 16.0, -8, 5.0),
    ):
        heaps = rng.uniform(-1.0, 1.0, (9, 3)) * np.array([1.25, 0.30, 0.5]) * size
        heaps[:, 1] += (0.42 - 0.30 * np.abs(heaps[:, 0]) / size) * size
        swell = rng.uniform(0.35, 0.62, 9) * size
        count = round(240 * size**1.05)
        of = rng.integers(0, 9, count)
        out = directions(count, rng)
        place = heaps[of] + out * (swell[of] * rng.uniform(0.2, 1.0, count) ** 0.5)[:, None]
        place[:, 1] = np.maximum(place[:, 1], rng.uniform(-0.12, 0.02, count) * size)
        at.append(place + np.array([x, y, z]))
        normals.append(unit(out + 0.5 * place / size))
        sizes.append(swell[of] * rng.uniform(1.0, 2.2, count))
    return np.concatenate(at), np.concatenate(normals), np.concatenate(sizes)


def galaxy(folder: Path) -> Path:
    """A spiral galaxy seen from above its plane: 14,000 soft cards of stars, gas and dust on a black sky."""
    author = StageAuthor(folder / "galaxy.usdc")
    rng = np.random.default_rng(67)
    author.sky(60.0, (0.001, 0.001, 0.004))
    author.mesh("Core", sphere(0.22, 16, 24), author.material("Core", (1.0, 0.95, 0.8), 1.0, (0.5, 0.45, 0.3)))
    eye = np.array([0.8, 8.6, 10.5])
    count = 14000
    reach = 0.15 + 6.6 * rng.beta(1.15, 2.4, count)
    arm = rng.integers(0, 4, count)
    loose = np.where(arm < 2, 0.16, 0.30) + np.where(rng.uniform(size=count) < 0.22, 1.0, 0.0)
    angle = 0.5 * np.pi * (2 * (arm % 2) + arm // 2) - 2.9 * np.log(reach + 0.35) + rng.normal(size=count) * loose
    thick = 0.07 + 0.42 * np.exp(-reach / 0.7)
    at = np.column_stack((reach * np.cos(angle), thick * rng.normal(size=count), reach * np.sin(angle)))
    look = unit(unit(eye - at) + 0.2 * rng.normal(size=(count, 3)))
    warm = np.exp(-reach / 1.1)[:, None]
    cold = np.where(rng.uniform(size=(count, 1)) < 0.12, np.array([[0.90, 0.22, 0.45]]), np.array([[0.25, 0.42, 0.95]]))
    colours = np.clip(warm * np.array([1.0, 0.80, 0.45]) + (1 - warm) * cold * rng.uniform(0.3, 1.3, (count, 1)), 0, 1)
    dust = rng.uniform(size=count) < 0.16
    colours[dust] = (0.06, 0.025, 0.015)
    size = (0.30 + 0.085 * reach) * rng.uniform(0.6, 2.0, count)
    soft = author.soft("Gas", author.image("gas.png", glow(0.16)))
    author.sprites("Gas", sprites(at, look, size, rng), look, colours, soft)
    stars = directions(1400, rng) * 55.0
    spark = author.soft("Star", author.image("star.png", glow(0.95)))
    tones = np.clip(rng.normal(0.85, 0.12, (1400, 3)), 0, 1)
    author.sprites("Stars", sprites(stars, -unit(stars), rng.uniform(0.1, 0.45, 1400), rng), -unit(stars), tones, spark)
    author.camera("Front", (0.8, 8.6, 10.5), (0.0, -0.4, 0.0), 40.0)
    author.camera("Low", (-8.5, 3.6, 9.0), (0.0, 0.0, 0.0), 38.0)
    author.camera("Near", (2.5, 4.2, 5.5), (0.3, 0.0, 0.3), 46.0)
    return author.save()
