"""Deep sample scene of a CAD assembly in x-ray: a jet engine of 2,600 nested parts at low opacity."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from pxr import UsdShade

from renderer.samples.author import StageAuthor
from renderer.samples.shapes import Polygons, box, disc, grid_faces, lathe, rounded, sphere, tube

# Each row of blades along the axis, metres: name, place, hub radius, tip radius, chord, blades, twist in degrees, look.
_ROWS = (
    ("Fan", -1.62, 0.34, 1.20, 0.34, 22, 28.0, "Titanium"),
    ("FanVanes", -0.92, 0.66, 1.19, 0.24, 40, -12.0, "Steel"),
    *(
        (f"Booster{i}", -1.08 + 0.17 * i, 0.42 - 0.01 * i, 0.60 - 0.02 * i, 0.075, 54, 24.0, "Titanium")
        for i in range(3)
    ),
    *(
        (f"BoosterVanes{i}", -1.0 + 0.17 * i, 0.42 - 0.01 * i, 0.60 - 0.02 * i, 0.06, 60, -18.0, "Steel")
        for i in range(3)
    ),
    *(
        (f"Compressor{i}", -0.42 + 0.105 * i, 0.24 + 0.012 * i, 0.42 - 0.008 * i, 0.05, 48 + 3 * i, 26.0, "Titanium")
        for i in range(9)
    ),
    *(
        (f"CompressorVanes{i}", -0.37 + 0.105 * i, 0.25 + 0.012 * i, 0.42 - 0.008 * i, 0.042, 56, -18.0, "Steel")
        for i in range(9)
    ),
    *((f"Turbine{i}", 1.12 + 0.15 * i, 0.34, 0.46, 0.075, 60, 30.0, "Hot") for i in range(2)),
    *((f"LowTurbine{i}", 1.46 + 0.16 * i, 0.36, 0.54 + 0.05 * i, 0.08, 70, 30.0, "Nickel") for i in range(5)),
    *((f"TurbineVanes{i}", 1.38 + 0.16 * i, 0.36, 0.52 + 0.05 * i, 0.07, 56, -22.0, "Steel") for i in range(5)),
)
_LOOKS = {
    "Casing": ((0.55, 0.70, 0.85), 0.06),
    "Duct": ((0.40, 0.60, 0.80), 0.07),
    "Titanium": ((0.30, 0.50, 0.80), 0.14),
    "Steel": ((0.55, 0.62, 0.68), 0.10),
    "Shaft": ((0.85, 0.65, 0.25), 0.22),
    "Disk": ((0.25, 0.60, 0.62), 0.12),
    "Hot": ((0.95, 0.35, 0.12), 0.20),
    "Nickel": ((0.80, 0.50, 0.25), 0.14),
    "Pipe": ((0.35, 0.65, 0.40), 0.20),
    "Bolt": ((0.45, 0.45, 0.50), 0.25),
}


def turbofan(folder: Path) -> Path:
    """A turbofan in x-ray: casings, 38 rows of instanced blades on their disks, shafts, combustor, pipes and bolts."""
    author = StageAuthor(folder / "turbofan.usdc")
    looks = {name: author.material(name, colour, opacity) for name, (colour, opacity) in _LOOKS.items()}
    author.sky(30.0, (0.05, 0.09, 0.16), horizon=-1.9)
    author.mesh("Floor", disc(29.5, 0.1).moved(by=(0.3, -1.9, 0)), author.material("Floor", (0.05, 0.07, 0.10)))
    for name, x in (("Fore", -0.9), ("Aft", 1.3)):
        author.mesh(
            f"Stand/{name}", box((0.2, 0.55, 1.3)).moved(by=(x, -1.65, 0)), author.material(name, (0.2, 0.22, 0.25))
        )
    _casings(author, looks)
    author.prototypes("Parts")
    for name, x, hub, tip, chord, count, twist, look in _ROWS:
        author.mesh(f"Parts/{name}/Blade", _blade(hub, tip, chord, twist), looks[look])
        _around(author, f"Blades/{name}", f"Parts/{name}", count, x)
        if "Vanes" not in name:
            disk = [
                (0.16, -0.02),
                (hub - 0.05, -0.012),
                (hub, -0.4 * chord),
                (hub, 0.4 * chord),
                (hub - 0.05, 0.012),
                (0.16, 0.02),
            ]
            author.mesh(f"Disks/{name}", _axial([(r, h + x) for r, h in disk]), looks["Disk"])
    _core(author, looks)
    author.camera("Front", (-2.7, 0.8, 2.7), (0.2, -0.05, 0.0), 36.0)
    author.camera("Side", (0.5, 0.5, 4.4), (0.35, -0.1, 0.0), 36.0)
    author.camera("Near", (-0.9, 0.6, 2.0), (0.35, 0.0, 0.0), 42.0)
    return author.save()


def _axial(profile: list[tuple[float, float]], around: int = 72) -> Polygons:
    """A profile of (radius, place along x) turned round the x axis."""
    return lathe(profile, around).turned(2, -90.0)


def _casings(author: StageAuthor, looks: dict[str, UsdShade.Material]) -> None:
    nacelle = [(1.24, -2.05), (1.36, -1.95), (1.46, -1.5), (1.48, -0.7), (1.38, 0.4), (1.16, 1.3)]
    for name, inset in (("Outer", 0.0), ("Liner", 0.07), ("Inner", 0.14)):
        author.mesh(f"Casings/{name}", _axial(rounded([(r - inset, x) for r, x in nacelle], 8)), looks["Casing"])
    cowl = [(0.64, -1.15), (0.74, -0.6), (0.78, 0.2), (0.74, 1.0), (0.66, 1.7), (0.60, 2.25)]
    for name, inset in (("Cowl", 0.0), ("CowlInside", 0.04)):
        author.mesh(f"Casings/{name}", _axial(rounded([(r - inset, x) for r, x in cowl], 8)), looks["Duct"])
    core = [
        (0.62, -1.1),
        (0.54, -0.62),
        (0.45, -0.45),
        (0.36, 0.5),
        (0.52, 0.62),
        (0.52, 1.0),
        (0.48, 1.15),
        (0.56, 1.5),
        (0.78, 2.2),
    ]
    for name, out in (("Core", 0.0), ("CoreOutside", 0.025)):
        author.mesh(f"Casings/{name}", _axial([(r + out, x) for r, x in core]), looks["Duct"])
    for number, x in enumerate((-1.3, -0.5, 0.3, 1.1)):
        ring = [(1.40, x - 0.02), (1.47, x - 0.02), (1.47, x + 0.02), (1.40, x + 0.02), (1.40, x - 0.02)]
        author.mesh(f"Casings/Flange{number}", _axial(ring), looks["Steel"])
    spinner = [(0.0, -2.02), (0.14, -1.95), (0.26, -1.8), (0.34, -1.6), (0.36, -1.45)]
    author.mesh("Casings/Spinner", _axial(rounded(spinner, 5)), looks["Titanium"])
    author.mesh(
        "Casings/Cone", _axial(rounded([(0.36, 2.15), (0.3, 2.5), (0.14, 2.85), (0.0, 2.95)], 5)), looks["Nickel"]
    )


def _core(author: StageAuthor, looks: dict[str, UsdShade.Material]) -> None:
    """Shafts, bearings, combustor with its injectors, pipes, gear box, bolts."""
    for name, radius, begin, end in (("Low", 0.07, -1.7, 2.2), ("High", 0.12, -0.5, 1.3), ("Sleeve", 0.15, -0.5, 1.3)):
        for side, inset in (("Outside", 0.0), ("Inside", 0.015)):
            author.mesh(
                f"Shafts/{name}{side}", _axial([(radius - inset, begin), (radius - inset, end)], 36), looks["Shaft"]
            )
    for number, (low, high) in enumerate(((0.30, 0.50), (0.33, 0.47), (0.36, 0.44))):
        ring = rounded(
            [(0.4, 0.55), (high, 0.62), (high, 0.95), (0.42, 1.06), (low, 0.95), (low, 0.62), (0.4, 0.55)], 4
        )
        author.mesh(f"Combustor/Liner{number}", _axial(ring), looks["Hot"])
    author.prototypes("Fittings")
    author.mesh(
        "Fittings/Injector/Pipe",
        tube(np.array([[0, 0.62, 0], [0, 0.5, 0], [0.04, 0.42, 0], [0.1, 0.4, 0]]), 0.012, 10),
        looks["Pipe"],
    )
    author.mesh("Fittings/Injector/Nozzle", sphere(0.03, 8, 12).moved(by=(0.12, 0.4, 0)), looks["Hot"])
    _around(author, "Combustor/Injectors", "Fittings/Injector", 24, 0.55)
    author.mesh("Fittings/Bearing/Ball", sphere(0.02, 6, 10).moved(by=(0, 0.175, 0)), looks["Bolt"])
    for number, x in enumerate((-1.3, -0.48, 1.32, 2.1)):
        _around(author, f"Shafts/Bearing{number}", "Fittings/Bearing", 26, x)
    author.mesh(
        "Fittings/Bolt/Head",
        lathe([(0.0, 0.0), (0.018, 0.0), (0.018, 0.03), (0.0, 0.03)], 6).moved(by=(0, 1.44, 0)),
        looks["Bolt"],
    )
    for number, x in enumerate((-1.3, -0.5, 0.3, 1.1)):
        _around(author, f"Casings/Bolts{number}", "Fittings/Bolt", 72, x)
    t = np.linspace(0.0, 1.0, 40)
    for number in range(14):
        start, turn = 0.45 * number, 0.8 + 0.25 * (number % 4)
        angle, reach = start + turn * t, 0.82 + 0.03 * (number % 3) + 0.02 * np.sin(9 * t)
        path = np.column_stack((-0.4 + 0.1 * (number % 3) + 1.9 * t, reach * np.cos(angle), reach * np.sin(angle)))
        author.mesh(f"Pipes/Pipe{number}", tube(path, 0.018 + 0.006 * (number % 3), 12), looks["Pipe"])
    for number, (x, size) in enumerate(((-0.1, 0.34), (0.3, 0.26), (0.62, 0.2))):
        for side, scale in (("Case", 1.0), ("Inside", 0.9)):
            author.mesh(
                f"GearBox/{side}{number}",
                box((scale * size, 0.24 * scale, 0.5 * scale)).moved(by=(x, -0.98, 0)),
                looks["Steel"],
            )


def _blade(hub: float, tip: float, chord: float, twist: float) -> Polygons:
    """A cambered, twisted aerofoil from the hub outwards along y, its chord mostly along the x axis."""
    spans, around = 6, 12
    u = np.linspace(0.0, 1.0, spans)
    angle = 2.0 * np.pi * np.arange(around) / around
    along, across = 0.5 * np.cos(angle), 0.06 * np.sin(angle)
    across = across + 0.10 * (0.25 - along**2)
    turn = np.radians(twist * (0.7 + 0.9 * u))[:, None]
    scale = chord * (1.0 - 0.15 * u)[:, None]
    x = scale * (along * np.cos(turn) - across * np.sin(turn))
    z = scale * (along * np.sin(turn) + across * np.cos(turn))
    y = np.broadcast_to((hub + (tip - hub) * u)[:, None], x.shape)
    return Polygons(np.stack((x, y, z), axis=2).reshape(-1, 3), grid_faces(spans, around, close_columns=True))


def _around(author: StageAuthor, path: str, prototype: str, count: int, x: float) -> None:
    """A ring of instances round the x axis."""
    half = np.pi * np.arange(count) / count
    turns = np.column_stack((np.cos(half), np.sin(half), np.zeros((count, 2))))
    at = np.tile((x, 0.0, 0.0), (count, 1))
    author.scatter(path, [prototype], np.zeros(count, np.int64), at, turns, np.ones(count))
