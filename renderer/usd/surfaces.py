"""Surface shaders, of UsdPreviewSurface and of MaterialX, as what alpha blending can show: colour, emission, opacity.

Alpha blending has no refraction: a surface that transmits light is glass (`renderer.usd.glass`), or, read plainly, a
tint of low opacity. Elsewhere `opacityMode` does not matter, since a highlight is blended with the rest ("presence").
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from pxr import UsdShade

from renderer.usd.drivers import ONES, ZEROS, Driver, Vec4, constant, number, number_of, product
from renderer.usd.networks import Network, category_of

OPACITY_OF_GLASS = 0.25
"""What alpha blending shows of a surface that transmits all light: its tint, not its refraction."""


NOTHING, SOLID = constant(ZEROS), constant(ONES)


@dataclass(frozen=True, slots=True)
class Glass:
    """What makes a surface a thin dielectric; of its two opacities at most one varies, and is the surface's `opacity`.

    Attributes:
        reflectance: Fraction of light that is reflected facing the eye, and at a silhouette.
        said: What the material says, for reports.
        transmittance: Mean of the tint, where that is not the surface's colour; None: it is.
        body: Share of light that is not transmitted, where it is the same everywhere.
        presence: Opacity of all of it, where that is the same everywhere.
        has_presence: Whether `opacity` is the presence; else it is the body.
    """

    reflectance: tuple[float, float]
    said: str
    transmittance: float | None = None
    body: float = 0.0
    presence: float = 1.0
    has_presence: bool = False


@dataclass(frozen=True, slots=True)
class Surface:
    """What a material says about colour and opacity.

    Attributes:
        colour: Linear RGB; of glass, most often the tint of what goes through.
        emission: Linear RGB that is added.
        opacity: In [0,1].
        threshold: `opacityThreshold`; above 0 the surface is a cut-out.
        glass: What makes it glass; None: it is none.
    """

    colour: Driver
    emission: Driver = NOTHING
    opacity: Driver = SOLID
    threshold: float = 0.0
    glass: Glass | None = None


def preview_surface(network: Network, shader: UsdShade.Shader) -> Surface:
    """UsdPreviewSurface, as a USD shader or as a MaterialX node."""
    return Surface(
        colour=network.drive(shader.GetInput("diffuseColor"), (0.18, 0.18, 0.18, 1.0)),
        emission=network.drive(shader.GetInput("emissiveColor"), ZEROS),
        opacity=network.drive(shader.GetInput("opacity"), ONES),
        threshold=network.number(shader, "opacityThreshold", 0.0),
    )


@dataclass(frozen=True, slots=True)
class _Inputs:
    """Names of the inputs of a MaterialX surface; "" where it has no such input.

    Attributes:
        weight: Factor on the colour.
        colour: Base colour, `grey` by default.
        grey: That default.
        opacity: Opacity.
        transmission: How much light goes through instead of being reflected.
        tint: The colour of that light.
        glow: Factor on the emission.
        dark: The default of that factor.
        emission: Emitted colour.
        lit: The default of that colour.
    """

    weight: str
    colour: str
    grey: float
    opacity: str
    transmission: str
    tint: str
    glow: str
    dark: float
    emission: str
    lit: float


MATERIALX = {
    "standard_surface": _Inputs(
        *("base", "base_color", 0.8, "opacity"),
        *("transmission", "transmission_color"),
        *("emission", 0.0, "emission_color", 1.0),
    ),
    # Its emission is in nits, which say nothing without an exposure.
    "open_pbr_surface": _Inputs(
        *("base_weight", "base_color", 0.8, "geometry_opacity"),
        *("transmission_weight", "transmission_color"),
        *("", 0.0, "", 0.0),
    ),
    "gltf_pbr": _Inputs(
        *("", "base_color", 1.0, "alpha"),
        *("transmission", "attenuation_color"),
        *("emissive_strength", 1.0, "emissive", 0.0),
    ),
}
"""By category of the surface shader."""


def materialx_surface(network: Network, shader: UsdShade.Shader) -> Surface:
    """standard_surface, open_pbr_surface and gltf_pbr (MaterialX specification 1.39, Physically Based Shading)."""
    names = MATERIALX[category_of(shader)]
    transmission = network.drive(shader.GetInput(names.transmission), ZEROS)
    if transmission.is_constant and transmission.number_bias > 0.5:
        colour = network.drive(shader.GetInput(names.tint), ONES)
    else:
        colour = base_colour(network, shader, category_of(shader))
    emission = NOTHING
    if names.emission:
        emission = network.drive(shader.GetInput(names.emission), grey(names.lit))
        emission = _weighted(network, shader, names.glow, names.dark, emission)
    elif network.number(shader, "emission_luminance", 0.0) > 0.0:
        network.log.add("emission in nits is left out", shader.GetPath())
    opacity = network.drive(shader.GetInput(names.opacity), ONES)
    surface = Surface(colour, emission, _through(network, shader, opacity, transmission))
    return _gltf_alpha(network, shader, surface) if names.opacity == "alpha" else surface


def base_colour(network: Network, shader: UsdShade.Shader, kind: str) -> Driver:
    """The base colour of a MaterialX surface times its weight."""
    names = MATERIALX[kind]
    return _weighted(network, shader, names.weight, 1.0, network.drive(shader.GetInput(names.colour), grey(names.grey)))


def _weighted(network: Network, shader: UsdShade.Shader, name: str, default: float, colour: Driver) -> Driver:
    """A colour times the number of that input; where both vary, the colour alone, with a warning."""
    weight = network.drive(shader.GetInput(name), grey(default)) if name else SOLID
    found = product(colour, repeated(weight))
    if found is None:
        network.log.add(f"{name} varies and so does its colour, it is left out", shader.GetPath())
    return colour if found is None else found


def repeated(driver: Driver) -> Driver:
    """A number that multiplies all channels alike."""
    return number(driver.number_bias) if driver.is_constant else driver.only(driver.number_channel)


def _through(network: Network, shader: UsdShade.Shader, opacity: Driver, transmission: Driver) -> Driver:
    """Opacity where light goes through: opacity * (1 - (1 - OPACITY_OF_GLASS) * transmission)."""
    less = -(1.0 - OPACITY_OF_GLASS)
    if transmission.is_constant:
        factor = 1.0 + less * min(max(transmission.number_bias, 0.0), 1.0)
        return opacity.times(grey(factor))
    found = product(repeated(opacity), repeated(transmission).times(grey(less)).plus(ONES))
    if found is None:
        network.log.add("transmission varies and so does opacity, it is left out", shader.GetPath())
    return opacity if found is None else found


def _gltf_alpha(network: Network, shader: UsdShade.Shader, surface: Surface) -> Surface:
    """`alpha_mode` of gltf_pbr: 0 ignores alpha, 1 cuts out at `alpha_cutoff`, 2 blends."""
    mode = number_of(network.value(shader.GetInput("alpha_mode")), 0.0)
    if mode == 1.0:
        return replace(surface, threshold=network.number(shader, "alpha_cutoff", 0.5))
    if mode == 2.0:
        return surface
    transmission = network.drive(shader.GetInput("transmission"), ZEROS)
    return replace(surface, opacity=_through(network, shader, SOLID, transmission))


def grey(value: float) -> Vec4:
    """A number in all four channels."""
    return value, value, value, value


SURFACES: dict[str, Callable[[Network, UsdShade.Shader], Surface]] = {
    "UsdPreviewSurface": preview_surface,
    **dict.fromkeys(MATERIALX, materialx_surface),
}
"""Readers by category of the surface shader."""
