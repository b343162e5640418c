"""Scenes of a few solids, as a user's file has them: text, with what makes each another one left open."""

from __future__ import annotations

from typing import Final

SPHERE_AND_CUBE: Final = """#usda 1.0
(
    defaultPrim = "World"
    metersPerUnit = 1
    upAxis = "Y"
)
def Xform "World"
{{
    def Sphere "outer"
    {{
        double radius = {radius}
        color3f[] primvars:displayColor = [(0.9, 0.4, 0.2)]
    }}
    def Cube "inner"
    {{
        double size = 1
        color3f[] primvars:displayColor = [(0.1, 0.5, 0.9)]
    }}
    def Camera "front"
    {{
        double3 xformOp:translate = (0, 0.5, 6)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }}
}}
"""
"""A sphere around a cube, with a camera; `radius` is the sphere's, metres."""
