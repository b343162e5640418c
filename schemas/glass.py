"""How surfaces that transmit light are read (docs/METHOD.md, section 1: Glass)."""

from __future__ import annotations

from typing import Literal, get_args

GlassReading = Literal["fresnel", "plain"]
"""`fresnel`: as a thin dielectric, whose opacity follows Schlick's Fresnel at the fragment's angle; `plain`: one
opacity for the whole surface: opacity 0 shows nothing, and a surface that transmits all light has 0.25."""

GLASS_READINGS: tuple[GlassReading, ...] = get_args(GlassReading)
DEFAULT_GLASS: GlassReading = "fresnel"

GLASS_HELP = (
    "Glass (opacity 0, or transmission): fresnel (opacity by the angle) or plain (one opacity, 0 shows nothing)."
)
