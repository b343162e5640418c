"""Surface shaders that transmit light, as thin dielectrics: what they reflect, and the tint of what goes through.

A surface has one colour: its tint, or where it transmits the smaller part of the light that of the rest. Refraction,
roughness and dispersion are left out. docs/METHOD.md, section 1, has what is drawn of it, with sources.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from pxr import UsdShade

from renderer.usd.drivers import ONES, ZEROS, Driver, number_of
from renderer.usd.networks import Network, category_of
from renderer.usd.surfaces import MATERIALX, Glass, Surface, base_colour, grey, repeated

IOR = 1.5
"""Index of refraction where a material has none: the default of every surface that is read."""

_MINUS = grey(-1.0)


def preview_glass(network: Network, shader: UsdShade.Shader) -> Surface | None:
    """UsdPreviewSurface of opacity 0: its diffuse part is gone, its specular part is not; None if it is anything else.

    "Presence" and a threshold say that there is no surface where the opacity is 0 (UsdPreviewSurface specification,
    `opacityMode`, `opacityThreshold`).
    """
    opacity = network.drive(shader.GetInput("opacity"), ONES)
    if not opacity.is_constant or opacity.number_bias > 0.0:
        return None
    if network.text(shader, "opacityMode", "transparent") == "presence":
        return None
    if network.number(shader, "opacityThreshold", 0.0) > 0.0:
        return None
    if network.number(shader, "useSpecularWorkflow", 0.0) >= 1.0:
        facing = _mean(network, shader, "specularColor", ZEROS)
        said = f"opacity 0, specular {facing:g}"
    else:
        ior = network.number(shader, "ior", IOR)
        facing, said = at_normal(ior), f"opacity 0, ior {ior:g}"
    _without_emission(network, shader, "emissiveColor", 1.0)
    # Nothing tints what goes through: the diffuse colour is multiplied by the opacity.
    return _pane(Driver(bias=ONES), Driver(bias=ONES), Driver(bias=ONES), 0.0, Glass((facing, 1.0), said))


@dataclass(frozen=True, slots=True)
class _Inputs:
    """Names of the inputs of a MaterialX surface that make it glass.

    Attributes:
        weight: Factor on what is reflected.
        colour: Colour of what is reflected.
        ior: Index of refraction.
    """

    weight: str
    colour: str
    ior: str


_MATERIALX = {
    "standard_surface": _Inputs("specular", "specular_color", "specular_IOR"),
    "open_pbr_surface": _Inputs("specular_weight", "specular_color", "specular_ior"),
    "gltf_pbr": _Inputs("specular", "specular_color", "ior"),
}


def materialx_glass(network: Network, shader: UsdShade.Shader) -> Surface | None:
    """standard_surface, open_pbr_surface and gltf_pbr that transmit light; None if they do not."""
    kind = category_of(shader)
    names = MATERIALX[kind]
    transmission = network.drive(shader.GetInput(names.transmission), ZEROS)
    if transmission.is_constant and transmission.number_bias <= 0.0:
        return None
    threshold, presence = 0.0, network.drive(shader.GetInput(names.opacity), ONES)
    if kind == "gltf_pbr":
        mode = number_of(network.value(shader.GetInput("alpha_mode")), 0.0)
        presence = presence if mode in (1.0, 2.0) else Driver(bias=ONES)
        threshold = network.number(shader, "alpha_cutoff", 0.5) if mode == 1.0 else 0.0
    tint, through = _tint(network, shader, kind, transmission)
    ior = network.number(shader, _MATERIALX[kind].ior, IOR)
    amount = f"{transmission.number_bias:g}" if transmission.is_constant else f"from {_source(transmission)}"
    glass = Glass(_reflectance(network, shader, kind, ior), f"transmission {amount}, ior {ior:g}", through)
    made = _pane(tint, transmission, presence, threshold, glass)
    if made is not None:
        factor = network.number(shader, names.glow, names.dark) if names.glow else 1.0
        _without_emission(network, shader, names.emission or "emission_luminance", factor)
    return made


def at_normal(ior: float) -> float:
    """Reflectance of a dielectric at normal incidence, by Fresnel's equations."""
    ior = max(ior, 0.0)
    return ((ior - 1.0) / (ior + 1.0)) ** 2


def _reflectance(network: Network, shader: UsdShade.Shader, kind: str, ior: float) -> tuple[float, float]:
    """Facing the eye and at a silhouette, with the specular weight and colour as each model has them."""
    names = _MATERIALX[kind]
    weight = _clamped(network.number(shader, names.weight, 1.0))
    colour = _mean(network, shader, names.colour, ONES)
    if kind == "open_pbr_surface":
        # The weight changes the index; the reflection at a silhouette is white but for the colour.
        return _clamped(weight * at_normal(ior)) * _clamped(colour), _clamped(colour)
    if kind == "gltf_pbr":
        return _clamped(colour * at_normal(ior)) * weight, weight
    return weight * _clamped(colour) * at_normal(ior), weight * _clamped(colour)


def _tint(network: Network, shader: UsdShade.Shader, kind: str, transmission: Driver) -> tuple[Driver, float | None]:
    """The colour of the surface, and where that is not what light becomes on its way through it, the mean of that."""
    if kind == "gltf_pbr":
        # glTF's base colour tints what is transmitted as well (KHR_materials_transmission).
        return base_colour(network, shader, kind).times(_attenuation(network, shader)), None
    if transmission.is_constant and transmission.number_bias > 0.5:
        return network.drive(shader.GetInput(MATERIALX[kind].tint), ONES), None
    through = _mean(network, shader, MATERIALX[kind].tint, ONES)
    return base_colour(network, shader, kind), _clamped(through)


def _attenuation(network: Network, shader: UsdShade.Shader) -> tuple[float, float, float, float]:
    """Beer's law over half of the thickness: light passes two surfaces of a volume (KHR_materials_volume).

    Without a distance and a thickness the colour itself is what is left.
    """
    colour = network.drive(shader.GetInput("attenuation_color"), ONES)
    if not colour.is_constant:
        network.log.add("attenuation_color varies, it is left out", shader.GetPath())
        return ONES
    distance = network.number(shader, "attenuation_distance", 0.0)
    thickness = network.number(shader, "thickness", 0.0)
    path = thickness / (2.0 * distance) if distance > 0.0 and thickness > 0.0 else 1.0
    red, green, blue = (_clamped(x) ** path for x in colour.rgb)
    return red, green, blue, 1.0


def _pane(tint: Driver, transmission: Driver, presence: Driver, threshold: float, glass: Glass) -> Surface | None:
    """A surface of glass; None where its opacity varies in a way that only a plain surface has."""
    body = repeated(transmission).times(_MINUS).plus(ONES)
    if presence.is_constant:
        there = _clamped(presence.number_bias)
        if threshold > 0.0:
            there = float(there >= threshold)
        kept = replace(glass, presence=there)
        return Surface(tint, opacity=body, glass=kept) if there > 0.0 else None
    if presence.sampler is None or not transmission.is_constant:
        return None
    kept = replace(glass, body=_clamped(body.number_bias), has_presence=True)
    return Surface(tint, opacity=presence, threshold=threshold, glass=kept)


def _without_emission(network: Network, shader: UsdShade.Shader, name: str, factor: float) -> None:
    """Says that glass which emits light is drawn without it."""
    if factor <= 0.0:
        return
    emission = network.drive(shader.GetInput(name), ZEROS)
    if not emission.is_constant or max(emission.rgb) > 0.0:
        network.log.add("emission of glass is left out", shader.GetPath())


def _mean(network: Network, shader: UsdShade.Shader, name: str, default: tuple[float, float, float, float]) -> float:
    """Mean of a constant colour's channels; the default's, with a warning, where it varies."""
    colour = network.drive(shader.GetInput(name), default)
    if not colour.is_constant:
        network.log.add(f"{name} of glass varies, its default is used", shader.GetPath())
        return sum(default[:3]) / 3.0
    return max(sum(colour.rgb) / 3.0, 0.0)


def _source(driver: Driver) -> str:
    return driver.sampler.file.name if driver.sampler is not None else f"primvar {driver.primvar}"


def _clamped(x: float) -> float:
    return min(max(x, 0.0), 1.0)


GLASSES: dict[str, Callable[[Network, UsdShade.Shader], Surface | None]] = {
    "UsdPreviewSurface": preview_glass,
    **dict.fromkeys(_MATERIALX, materialx_glass),
}
"""Readers by category of the surface shader."""
