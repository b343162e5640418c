"""Deep sample scene of nested shells: a torso with its layers, bones, organs and vessels."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from pxr import UsdShade

from renderer.samples.author import StageAuthor
from renderer.samples.shapes import Floats, Polygons, disc, grid_faces, joined, sphere, tube, unit

# Of the outline, metres: height, half width, half depth, how far forward.
_OUTLINE = np.array(
    [
        (0.74, 0.165, 0.105, 0.00), (0.86, 0.175, 0.118, 0.00), (0.97, 0.152, 0.108, 0.01), (1.08, 0.142, 0.100, 0.01),
        (1.20, 0.162, 0.114, 0.01), (1.31, 0.178, 0.120, 0.01), (1.39, 0.180, 0.104, 0.00), (1.435, 0.150, 0.084, 0.00),
        (1.46, 0.085, 0.066, 0.00), (1.49, 0.060, 0.060, 0.00), (1.53, 0.057, 0.062, 0.01), (1.56, 0.064, 0.082, 0.02),
        (1.61, 0.074, 0.096, 0.02), (1.67, 0.078, 0.100, 0.01), (1.73, 0.068, 0.088, 0.00), (1.765, 0.042, 0.056, 0.00),
        (1.78, 0.002, 0.002, 0.00),
    ]
)  # fmt: skip
_LOOKS = {
    "Skin": ((0.92, 0.72, 0.60), 0.08),
    "Fascia": ((0.95, 0.85, 0.62), 0.05),
    "Sheath": ((0.70, 0.25, 0.22), 0.06),
    "Muscle": ((0.78, 0.22, 0.18), 0.10),
    "Bone": ((0.94, 0.91, 0.80), 0.40),
    "Disc": ((0.60, 0.72, 0.78), 0.35),
    "Lung": ((0.92, 0.52, 0.56), 0.12),
    "Airway": ((0.75, 0.88, 0.95), 0.30),
    "Heart": ((0.75, 0.10, 0.12), 0.30),
    "Artery": ((0.85, 0.08, 0.08), 0.45),
    "Vein": ((0.12, 0.20, 0.65), 0.40),
    "Liver": ((0.48, 0.16, 0.10), 0.30),
    "Stomach": ((0.88, 0.58, 0.42), 0.24),
    "Bowel": ((0.90, 0.62, 0.52), 0.17),
    "Kidney": ((0.58, 0.18, 0.14), 0.36),
    "Brain": ((0.86, 0.66, 0.66), 0.30),
    "Cranium": ((0.94, 0.91, 0.80), 0.14),
}
Looks = dict[str, UsdShade.Material]


def anatomy(folder: Path) -> Path:
    """A torso with head: skin, fascia, muscles, skeleton, brain, airways, vessels and organs inside each other."""
    author = StageAuthor(folder / "anatomy.usdc")
    rng = np.random.default_rng(73)
    looks = {name: author.material(name, colour, opacity) for name, (colour, opacity) in _LOOKS.items()}
    author.sky(12.0, (0.05, 0.08, 0.14))
    author.mesh("Floor", disc(11.8, 0.1), author.material("Floor", (0.03, 0.05, 0.08)))
    author.mesh("Plinth", disc(0.34, 0.06).moved(by=(0, 0.71, 0)), author.material("Plinth", (0.24, 0.27, 0.32)))
    shells = (("Skin", "Skin", 0.0), ("Dermis", "Fascia", 0.003), ("Fat", "Fascia", 0.009), ("Sheath", "Sheath", 0.015))
    for name, look, inset in shells:
        author.mesh(f"Shells/{name}", _body(inset), looks[look])
    for side in (-1.0, 1.0):
        arm = _smooth(
            [
                (0.17 * side, 1.395, 0.0),
                (0.235 * side, 1.33, -0.01),
                (0.275 * side, 1.08, -0.01),
                (0.315 * side, 0.80, 0.04),
            ]
        )
        girth = np.interp(np.linspace(0, 1, len(arm)), (0, 0.15, 0.5, 0.6, 1), (0.055, 0.062, 0.045, 0.047, 0.03))
        for name, share in (("Skin", 1.0), ("Fascia", 0.90), ("Muscle", 0.74), ("Bone", 0.28)):
            author.mesh(f"Arms/{name}{side > 0:d}", tube(arm, share * girth, 20), looks[name])
    _muscles(author, looks)
    _skeleton(author, looks)
    _chest(author, looks, rng)
    _belly(author, looks)
    _vessels(author, looks, rng)
    author.camera("Front", (0.14, 1.28, 0.84), (0.0, 1.19, 0.0), 36.0)
    author.camera("Side", (0.85, 1.35, 0.45), (0.0, 1.22, 0.0), 38.0)
    author.camera("Whole", (0.25, 1.36, 1.55), (0.0, 1.27, 0.0), 38.0)
    return author.save()


def _body(inset: float) -> Polygons:
    """The outline as a closed shell, `inset` metres inside itself."""
    heights = np.linspace(_OUTLINE[0, 0], _OUTLINE[-1, 0], 90)
    wide, deep, ahead = (np.interp(heights, _OUTLINE[:, 0], _OUTLINE[:, i]) for i in (1, 2, 3))
    kernel = np.array([1.0, 4.0, 6.0, 4.0, 1.0]) / 16.0
    wide, deep, ahead = (np.convolve(np.pad(v, 2, "edge"), kernel, "valid") for v in (wide, deep, ahead))
    wide[-1] = deep[-1] = inset + 1e-4
    angle = -2.0 * np.pi * np.arange(56) / 56
    c, s = np.cos(angle), np.sin(angle)
    # A superellipse: shoulders and hips are squarer than an ellipse.
    x = np.maximum(wide - inset, 1e-4)[:, None] * np.sign(c) * np.abs(c) ** 0.85
    z = np.maximum(deep - inset, 1e-4)[:, None] * np.sign(s) * np.abs(s) ** 0.85 + ahead[:, None]
    y = np.broadcast_to(heights[:, None], x.shape)
    return Polygons(np.stack((x, y, z), axis=2).reshape(-1, 3), grid_faces(90, 56, close_columns=True))


def _ball(radii: tuple[float, float, float], at: tuple[float, float, float], rows: int = 16) -> Polygons:
    return sphere(1.0, rows, 2 * rows).moved(scale=radii, by=at)


def _smooth(points: list[tuple[float, float, float]], steps: int = 30) -> Floats:
    """A smooth path [steps, 3] near some points."""
    p = np.array(points)
    path = np.column_stack([np.interp(np.linspace(0, len(p) - 1, steps), np.arange(len(p)), p[:, i]) for i in range(3)])
    for _ in range(12):
        path[1:-1] = 0.25 * path[:-2] + 0.5 * path[1:-1] + 0.25 * path[2:]
    return path


def _muscles(author: StageAuthor, looks: Looks) -> None:
    """Flat ellipsoids in two layers each: chest, belly, back, shoulders, neck."""
    places: list[tuple[tuple[float, float, float], tuple[float, float, float]]] = []
    for side in (-1.0, 1.0):
        places += [
            ((0.082, 0.058, 0.018), (0.080 * side, 1.325, 0.103)),
            ((0.055, 0.07, 0.055), (0.195 * side, 1.36, 0.0)),
        ]
        places += [((0.033, 0.034, 0.012), (0.038 * side, 1.20 - 0.075 * row, 0.106)) for row in range(4)]
        places += [
            ((0.022, 0.14, 0.06), (0.130 * side, 1.02, 0.02)),
            ((0.10, 0.13, 0.02), (0.075 * side, 1.28, -0.088)),
        ]
        places += [
            ((0.03, 0.24, 0.022), (0.035 * side, 1.05, -0.085)),
            ((0.018, 0.07, 0.02), (0.035 * side, 1.50, 0.03)),
        ]
        places += [
            ((0.09, 0.09, 0.05), (0.085 * side, 0.83, -0.065)),
            ((0.07, 0.05, 0.03), (0.075 * side, 1.42, -0.045)),
        ]
    for layer, share in enumerate((1.0, 0.8, 0.6)):
        pieces = [_ball((r[0] * share, r[1] * share, r[2] * share), at, 12) for r, at in places]
        author.mesh(f"Muscles/Layer{layer}", joined(pieces), looks["Muscle"])


def _skeleton(author: StageAuthor, looks: Looks) -> None:
    """Spine with its discs, ribs, breastbone, collar and shoulder bones, hips, skull."""
    y = np.linspace(0.86, 1.54, 26)
    z = -0.060 + 0.022 * np.sin(2.0 * np.pi * (y - 0.86) / 0.68) + 0.03 * np.clip((y - 1.4) / 0.14, 0, 1)
    size = np.linspace(0.026, 0.016, 26)
    bones = [_ball((r, 0.010, 0.85 * r), (0.0, h, d), 8) for h, d, r in zip(y, z, size, strict=True)]
    spines = [_ball((0.006, 0.008, 0.024), (0.0, h - 0.006, d - 0.032), 6) for h, d in zip(y, z, strict=True)]
    author.mesh("Bones/Spine", joined([*bones, *spines]), looks["Bone"])
    between = [_ball((0.9 * r, 0.0045, 0.8 * r), (0.0, h + 0.0136, d), 8) for h, d, r in zip(y, z, size, strict=True)]
    author.mesh("Bones/Discs", joined(between), looks["Disc"])
    ribs = []
    t = np.linspace(0.0, 1.0, 26)
    for number in range(12):
        top, swell = 1.425 - 0.031 * number, np.sin(np.pi * (number + 2.5) / 15.0)
        reach = 1.0 if number < 8 else 0.93 - 0.14 * (number - 8)
        angle = np.pi * (-0.5 + reach * t)
        for side in (-1.0, 1.0):
            x = side * (0.010 + (0.070 + 0.072 * swell) * np.cos(angle))
            depth = (0.070 + 0.030 * swell) * np.sin(angle) + 0.012
            ribs.append(tube(np.column_stack((x, top - 0.055 * np.sin(0.5 * np.pi * t), depth)), 0.0062, 8))
    author.mesh("Bones/Ribs", joined(ribs), looks["Bone"])
    flat = [_ball((0.018, 0.075, 0.007), (0.0, 1.315, 0.107), 10)]
    for side in (-1.0, 1.0):
        collar = _smooth([(0.015 * side, 1.405, 0.085), (0.09 * side, 1.42, 0.07), (0.175 * side, 1.41, 0.0)])
        flat += [_ball((0.045, 0.065, 0.007), (0.095 * side, 1.33, -0.095), 10)]
        flat += [_ball((0.075, 0.070, 0.018), (0.075 * side, 0.875, -0.015), 12)]
        flat += [_ball((0.028, 0.028, 0.028), (0.125 * side, 0.80, 0.0), 8)]
        author.mesh(f"Bones/Collar{side > 0:d}", tube(collar, 0.007, 10), looks["Bone"])
    author.mesh("Bones/Flat", joined(flat), looks["Bone"])
    for name, share in (("Skull", 1.0), ("SkullInside", 0.93)):
        author.mesh(
            f"Head/{name}",
            _ball((0.068 * share, 0.078 * share, 0.088 * share), (0, 1.685, 0.003), 20),
            looks["Cranium"],
        )
    author.mesh(
        "Head/Jaw",
        tube(
            _smooth(
                [
                    (-0.055, 1.62, 0.0),
                    (-0.045, 1.575, 0.05),
                    (0.0, 1.562, 0.09),
                    (0.045, 1.575, 0.05),
                    (0.055, 1.62, 0.0),
                ]
            ),
            0.009,
            10,
        ),
        looks["Bone"],
    )
    for side in (-1.0, 1.0):
        half = sphere(1.0, 40, 60)
        up, ahead = half.points[:, 1], half.points[:, 2]
        fold = 1.0 + 0.035 * (1.0 - up**2) * np.sin(16.0 * up + 4.0 * np.sin(7.0 * ahead))
        lobe = Polygons(half.points * fold[:, None], half.faces).moved(
            scale=(0.027, 0.058, 0.072), by=(0.029 * side, 1.695, 0.0)
        )
        author.mesh(f"Head/Brain{side > 0:d}", lobe, looks["Brain"])
        author.mesh(
            f"Head/Eye{side > 0:d}", _ball((0.012, 0.012, 0.012), (0.03 * side, 1.665, 0.092), 8), looks["Disc"]
        )
    author.mesh("Head/Cerebellum", _ball((0.038, 0.022, 0.028), (0.0, 1.638, -0.045), 12), looks["Brain"])


def _chest(author: StageAuthor, looks: Looks, rng: np.random.Generator) -> None:
    """Lungs round their airways, the heart and its chambers, the diaphragm."""
    airways = [tube(_smooth([(0.0, 1.55, 0.03), (0.0, 1.45, 0.015), (0.0, 1.345, 0.0)]), 0.0095, 12)]
    for side in (-1.0, 1.0):
        for layer, share in enumerate((1.0, 0.9, 0.75)):
            lung = _ball((0.056 * share, 0.118 * share, 0.078 * share), (0.077 * side, 1.285, 0.005), 20)
            author.mesh(f"Chest/Lung{side > 0:d}{layer}", lung, looks["Lung"])
        root = np.array([0.0, 1.345, 0.0])
        _branch(airways, root, np.array([0.8 * side, -0.6, 0.0]), 0.046, 0.007, 6, rng)
    author.mesh("Chest/Airways", joined(airways), looks["Airway"])
    for name, radii, at in (
        ("Wall", (0.048, 0.060, 0.046), (0.022, 1.265, 0.045)),
        ("WallInside", (0.043, 0.055, 0.041), (0.022, 1.265, 0.045)),
        ("LeftVentricle", (0.018, 0.032, 0.020), (0.038, 1.248, 0.045)),
        ("RightVentricle", (0.017, 0.030, 0.018), (0.004, 1.248, 0.055)),
        ("LeftAtrium", (0.018, 0.015, 0.018), (0.032, 1.298, 0.035)),
        ("RightAtrium", (0.018, 0.016, 0.018), (0.0, 1.298, 0.042)),
    ):
        author.mesh(f"Chest/Heart/{name}", _ball(radii, at), looks["Heart"])
    dome = sphere(1.0, 24, 40)
    kept = dome.faces[np.all(dome.points[dome.faces][:, :, 1] > -0.1, axis=1)]
    author.mesh(
        "Chest/Diaphragm",
        Polygons(dome.points, kept).moved(scale=(0.132, 0.055, 0.09), by=(0, 1.135, 0.01)),
        looks["Muscle"],
    )


def _branch(
    into: list[Polygons], at: Floats, way: Floats, length: float, radius: float, levels: int, rng: np.random.Generator
) -> None:
    """A tree of tubes, each of which splits in two."""
    end = at + unit(way) * length
    into.append(tube(np.linspace(at, end, 4), np.linspace(radius, 0.75 * radius, 4), 7))
    if levels == 0:
        return
    for _ in range(2):
        turn = unit(way) + 0.75 * unit(rng.normal(size=3))
        _branch(into, end, turn, 0.78 * length, 0.72 * radius, levels - 1, rng)


def _belly(author: StageAuthor, looks: Looks) -> None:
    """Liver, stomach, kidneys, spleen, bowels, bladder; hollow ones have two walls."""
    author.mesh("Belly/Liver", _ball((0.085, 0.042, 0.062), (-0.045, 1.115, 0.025)), looks["Liver"])
    author.mesh("Belly/LiverLobe", _ball((0.055, 0.03, 0.042), (0.03, 1.125, 0.045)), looks["Liver"])
    author.mesh("Belly/Gall", _ball((0.012, 0.022, 0.012), (-0.05, 1.075, 0.07), 10), looks["Airway"])
    author.mesh("Belly/Spleen", _ball((0.022, 0.045, 0.032), (0.11, 1.10, -0.02)), looks["Kidney"])
    stomach = _smooth(
        [(0.015, 1.17, 0.0), (0.05, 1.14, 0.03), (0.075, 1.09, 0.045), (0.05, 1.05, 0.06), (0.0, 1.05, 0.06)]
    )
    girth = np.interp(np.linspace(0, 1, len(stomach)), (0, 0.25, 0.6, 1), (0.010, 0.036, 0.034, 0.012))
    large = _smooth(
        [
            (-0.10, 0.88, 0.03),
            (-0.11, 1.02, 0.03),
            (-0.09, 1.05, 0.055),
            (0.0, 1.03, 0.085),
            (0.09, 1.05, 0.055),
            (0.11, 1.02, 0.03),
            (0.10, 0.90, 0.02),
            (0.03, 0.86, 0.0),
            (0.0, 0.80, -0.02),
        ],
        150,
    )
    bulge = 0.019 * (1.0 + 0.16 * np.sin(np.arange(150) * 1.1))
    for layer, share in enumerate((1.0, 0.8)):
        author.mesh(f"Belly/Stomach{layer}", tube(stomach, share * girth, 20), looks["Stomach"])
        author.mesh(f"Belly/Small{layer}", joined([_loop(i, 0.0125 * share) for i in range(22)]), looks["Bowel"])
        author.mesh(f"Belly/Large{layer}", tube(large, share * bulge, 14), looks["Bowel"])
    for side in (-1.0, 1.0):
        for layer, share in enumerate((1.0, 0.6)):
            kidney = _ball((0.026 * share, 0.048 * share, 0.022 * share), (0.065 * side, 1.06, -0.045), 12)
            author.mesh(f"Belly/Kidney{side > 0:d}{layer}", kidney, looks["Kidney"])
    author.mesh("Belly/Bladder", _ball((0.034, 0.028, 0.03), (0.0, 0.80, 0.045), 12), looks["Airway"])


def _loop(number: int, radius: float) -> Polygons:
    """A loop of the small bowel, one of rows that overlap."""
    angle = 2.0 * np.pi * np.arange(40) / 40
    turn, tilt = 0.9 * number, 0.5 * np.sin(2.3 * number)
    wide, high = 0.026 * np.cos(angle), 0.019 * np.sin(angle)
    x = wide * np.cos(turn) - high * np.sin(turn)
    y = wide * np.sin(turn) + high * np.cos(turn)
    row, column = divmod(number, 4)
    centre = np.array([-0.06 + 0.04 * column, 0.99 - 0.026 * row, 0.045 + 0.018 * np.cos(1.7 * number)])
    return tube(np.column_stack((x, y, tilt * x)) + centre, radius, 12, closed=True)


def _vessels(author: StageAuthor, looks: Looks, rng: np.random.Generator) -> None:
    """The aorta and the great veins, and trees that branch from them."""
    aorta = _smooth(
        [
            (0.02, 1.30, 0.04),
            (0.01, 1.36, 0.04),
            (0.02, 1.385, 0.0),
            (0.012, 1.34, -0.03),
            (0.012, 1.15, -0.035),
            (0.008, 0.95, -0.035),
        ],
        60,
    )
    cava = _smooth([(-0.012, 0.95, -0.035), (-0.018, 1.15, -0.03), (-0.012, 1.29, 0.03), (-0.015, 1.40, 0.02)], 60)
    for name, trunk, side in (("Artery", aorta, 1.0), ("Vein", cava, -1.0)):
        pieces = [tube(trunk, 0.0085, 12)]
        for end in (
            (0.10, 0.74, 0.0),
            (-0.10, 0.74, 0.0),
            (0.29, 0.90, 0.0),
            (-0.29, 0.90, 0.0),
            (0.03, 1.66, 0.02),
            (-0.03, 1.66, 0.02),
        ):
            start = trunk[0 if (end[1] > 0.8) ^ (side > 0) else -1] if end[1] < 0.8 else (0.012 * side, 1.385, 0.01)
            shoulder = (
                (0.62 * end[0], 1.37 if end[1] < 1.5 else 1.5, 0.0) if end[1] > 0.8 else (0.5 * end[0], 0.88, -0.02)
            )
            line = _smooth([tuple(start), shoulder, end], 24) + np.array([0.006 * side, 0.0, 0.004 * side])
            pieces.append(tube(line, np.linspace(0.005, 0.0025, 24), 8))
        for _ in range(18):
            at = trunk[int(rng.integers(20, 60))]
            _branch(pieces, at, rng.normal(size=3) * np.array([1.0, 0.6, 0.35]), 0.032, 0.003, 3, rng)
        author.mesh(f"Vessels/{name}", joined(pieces), looks[name])
