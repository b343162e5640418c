"""Writing of sample stages: a thin layer over usd-core for materials, meshes, instances and cameras."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade, Vt

from renderer.samples.shapes import Floats, Polygons, sphere
from renderer.usd.licence import LICENCE_KEYS

Colour = tuple[float, float, float]


class StageAuthor:
    """One stage that is being written.

    Args:
        file: Where it goes; the suffix decides between text and binary.
        up: `Y` or `Z`.
        metres: Metres per unit.
    """

    def __init__(self, file: Path, up: str = "Y", metres: float = 1.0) -> None:
        self.file = file
        self._undrawn: list[Usd.Prim] = []
        self.stage = Usd.Stage.CreateInMemory()
        self.stage.SetMetadata("comment", "A sample scene of Diaphane.")
        self.stage.GetRootLayer().customLayerData = {LICENCE_KEYS[0]: "Apache-2.0"}
        UsdGeom.SetStageUpAxis(self.stage, up)
        UsdGeom.SetStageMetersPerUnit(self.stage, metres)
        self.stage.SetDefaultPrim(UsdGeom.Xform.Define(self.stage, "/World").GetPrim())

    def save(self) -> Path:
        """Writes the file."""
        for prim in self._undrawn:
            prim.SetSpecifier(Sdf.SpecifierOver)
        self.stage.GetRootLayer().Export(str(self.file))
        return self.file

    def image(self, name: str, rgba: Floats) -> str:
        """Writes a PNG beside the stage and returns its asset path.

        Args:
            name: File name.
            rgba: float64 [h, w, 4] in [0,1], sRGB-encoded, row 0 at the top.
        """
        folder = self.file.parent / "textures"
        folder.mkdir(exist_ok=True)
        pixels = np.floor(np.clip(rgba, 0.0, 1.0) * 255.0 + 0.5).astype(np.uint8)
        Image.fromarray(pixels).save(folder / name, optimize=True)
        return f"./textures/{name}"

    def material(
        self, name: str, colour: Colour, opacity: float = 1.0, emission: Colour | None = None
    ) -> UsdShade.Material:
        """A UsdPreviewSurface of one linear colour and opacity."""
        material, shader = self._surface(name)
        shader.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f).Set(Gf.Vec3f(*colour))
        shader.CreateInput("opacity", Sdf.ValueTypeNames.Float).Set(opacity)
        if emission is not None:
            shader.CreateInput("emissiveColor", Sdf.ValueTypeNames.Color3f).Set(Gf.Vec3f(*emission))
        return material

    def textured(self, name: str, asset: str, opacity_scale: float = 1.0, threshold: float = 0.0) -> UsdShade.Material:
        """A UsdPreviewSurface with colour and opacity from an image's RGB and alpha, read through `st`."""
        material, shader = self._surface(name)
        texture = self._image_reader(material.GetPath(), asset)
        if opacity_scale != 1.0:
            texture.CreateInput("scale", Sdf.ValueTypeNames.Float4).Set(Gf.Vec4f(1, 1, 1, opacity_scale))
        shader.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f).ConnectToSource(
            texture.CreateOutput("rgb", Sdf.ValueTypeNames.Float3)
        )
        shader.CreateInput("opacity", Sdf.ValueTypeNames.Float).ConnectToSource(
            texture.CreateOutput("a", Sdf.ValueTypeNames.Float)
        )
        if threshold > 0.0:
            shader.CreateInput("opacityThreshold", Sdf.ValueTypeNames.Float).Set(threshold)
        return material

    def soft(self, name: str, asset: str) -> UsdShade.Material:
        """A UsdPreviewSurface with the colour of the primvar displayColor and the opacity of an image's alpha."""
        material, shader = self._surface(name)
        root = material.GetPath()
        colour = UsdShade.Shader.Define(self.stage, root.AppendChild("Colour"))
        colour.CreateIdAttr("UsdPrimvarReader_float3")
        colour.CreateInput("varname", Sdf.ValueTypeNames.String).Set("displayColor")
        shader.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f).ConnectToSource(
            colour.CreateOutput("result", Sdf.ValueTypeNames.Float3)
        )
        shader.CreateInput("opacity", Sdf.ValueTypeNames.Float).ConnectToSource(
            self._image_reader(root, asset).CreateOutput("a", Sdf.ValueTypeNames.Float)
        )
        return material

    def _image_reader(self, root: Sdf.Path, asset: str) -> UsdShade.Shader:
        """A clamped UsdUVTexture in a material, read through `st`."""
        reader = UsdShade.Shader.Define(self.stage, root.AppendChild("Coordinates"))
        reader.CreateIdAttr("UsdPrimvarReader_float2")
        reader.CreateInput("varname", Sdf.ValueTypeNames.String).Set("st")
        texture = UsdShade.Shader.Define(self.stage, root.AppendChild("Image"))
        texture.CreateIdAttr("UsdUVTexture")
        texture.CreateInput("file", Sdf.ValueTypeNames.Asset).Set(asset)
        texture.CreateInput("sourceColorSpace", Sdf.ValueTypeNames.Token).Set("sRGB")
        texture.CreateInput("wrapS", Sdf.ValueTypeNames.Token).Set("clamp")
        texture.CreateInput("wrapT", Sdf.ValueTypeNames.Token).Set("clamp")
        texture.CreateInput("st", Sdf.ValueTypeNames.Float2).ConnectToSource(
            reader.CreateOutput("result", Sdf.ValueTypeNames.Float2)
        )
        return texture

    def _surface(self, name: str) -> tuple[UsdShade.Material, UsdShade.Shader]:
        material = UsdShade.Material.Define(self.stage, f"/World/Looks/{name}")
        shader = UsdShade.Shader.Define(self.stage, f"/World/Looks/{name}/Surface")
        shader.CreateIdAttr("UsdPreviewSurface")
        material.CreateSurfaceOutput().ConnectToSource(shader.CreateOutput("surface", Sdf.ValueTypeNames.Token))
        return material, shader

    def mesh(self, path: str, shape: Polygons, material: UsdShade.Material | None = None) -> UsdGeom.Mesh:
        """A mesh under /World, smooth or flat as the shape says, bound to the material if one is given."""
        mesh = UsdGeom.Mesh.Define(self.stage, f"/World/{path}")
        points = np.ascontiguousarray(shape.points, dtype=np.float32)
        mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points))
        mesh.CreateExtentAttr(Vt.Vec3fArray.FromNumpy(np.stack((points.min(0), points.max(0)))))
        mesh.CreateFaceVertexCountsAttr(
            Vt.IntArray.FromNumpy(np.full(len(shape.faces), shape.faces.shape[1], np.int32))
        )
        mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(shape.faces.astype(np.int32).ravel()))
        # A cage of quads is smooth, and is drawn unrefined; polygons are flat.
        mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.catmullClark if shape.smooth else UsdGeom.Tokens.none)
        mesh.CreateDoubleSidedAttr(True)
        if shape.st is not None:
            primvar = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar(
                "st", Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.vertex
            )
            primvar.Set(Vt.Vec2fArray.FromNumpy(np.ascontiguousarray(shape.st, dtype=np.float32)))
        if material is not None:
            UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim()).Bind(material)
        return mesh

    def curves(
        self, path: str, points: Floats, widths: Floats, colours: Floats, opacity: Floats
    ) -> UsdGeom.BasisCurves:
        """Cubic Bezier curves under /World, with display colours and opacities.

        Args:
            path: Under /World.
            points: float64 [C, n, 3]; n = 4 + 3 i.
            widths: Diameters, constant along the curve, float64 [C].
            colours: Linear RGB of the curves, float64 [C, 3].
            opacity: At both ends of every segment, alike for all curves, float64 [(n - 1) / 3 + 1].
        """
        count, each = points.shape[:2]
        curves = UsdGeom.BasisCurves.Define(self.stage, f"/World/{path}")
        curves.CreateTypeAttr(UsdGeom.Tokens.cubic)
        curves.CreateBasisAttr(UsdGeom.Tokens.bezier)
        curves.CreateWrapAttr(UsdGeom.Tokens.nonperiodic)
        curves.CreateCurveVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(count, each, np.int32)))
        flat = np.ascontiguousarray(points.reshape(-1, 3), dtype=np.float32)
        curves.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(flat))
        curves.CreateExtentAttr(Vt.Vec3fArray.FromNumpy(np.stack((flat.min(0), flat.max(0)))))
        curves.CreateWidthsAttr(Vt.FloatArray.FromNumpy(widths.astype(np.float32)))
        curves.SetWidthsInterpolation(UsdGeom.Tokens.uniform)
        self.tint(curves, colours, np.tile(opacity, count), UsdGeom.Tokens.uniform, UsdGeom.Tokens.varying)
        return curves

    def points(self, path: str, points: Floats, widths: Floats, colours: Floats, opacity: Floats) -> UsdGeom.Points:
        """Points under /World that are drawn as small balls.

        Args:
            path: Under /World.
            points: float64 [P, 3].
            widths: Diameters, float64 [P].
            colours: Linear RGB, float64 [P, 3].
            opacity: float64 [P].
        """
        cloud = UsdGeom.Points.Define(self.stage, f"/World/{path}")
        places = np.ascontiguousarray(points, dtype=np.float32)
        cloud.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(places))
        cloud.CreateExtentAttr(Vt.Vec3fArray.FromNumpy(np.stack((places.min(0), places.max(0)))))
        cloud.CreateWidthsAttr(Vt.FloatArray.FromNumpy(widths.astype(np.float32)))
        cloud.SetWidthsInterpolation(UsdGeom.Tokens.vertex)
        self.tint(cloud, colours, opacity, UsdGeom.Tokens.vertex, UsdGeom.Tokens.vertex)
        return cloud

    def tint(
        self,
        prim: UsdGeom.Gprim,
        colours: Floats,
        opacity: Floats | None,
        of_colours: str,
        of_opacity: str = UsdGeom.Tokens.constant,
    ) -> None:
        """Display colours, linear RGB float64 [n, 3], and opacities float64 [m], with their interpolations."""
        prim.CreateDisplayColorPrimvar(of_colours).Set(Vt.Vec3fArray.FromNumpy(colours.astype(np.float32)))
        if opacity is not None:
            prim.CreateDisplayOpacityPrimvar(of_opacity).Set(Vt.FloatArray.FromNumpy(opacity.astype(np.float32)))

    def sprites(self, path: str, cards: Polygons, normals: Floats, colours: Floats, look: UsdShade.Material) -> None:
        """Flat cards of four points each, shaded as the volume that they stand for.

        Args:
            path: Under /World.
            cards: See `shapes.sprites`.
            normals: Of the volume at each card, float64 [M, 3]; all corners have it.
            colours: Linear RGB of each card, float64 [M, 3].
            look: From `soft`.
        """
        mesh = self.mesh(path, cards, look)
        mesh.CreateNormalsAttr(Vt.Vec3fArray.FromNumpy(normals.astype(np.float32)))
        mesh.SetNormalsInterpolation(UsdGeom.Tokens.uniform)
        self.tint(mesh, colours, None, UsdGeom.Tokens.uniform)

    def sky(self, radius: float, colour: Colour, horizon: float = 0.0) -> None:
        """An opaque sphere round a stage with y up, seen from inside.

        Its normals are vertical: above the horizon it has one dim colour, as no light comes from there; below, it is
        lit like a floor.

        Args:
            radius: In the stage's units.
            colour: Linear RGB.
            horizon: Height of its centre.
        """
        ball = sphere(radius, 12, 24).moved(by=(0.0, horizon, 0.0))
        mesh = self.mesh("Sky", Polygons(ball.points, ball.faces, smooth=False), self.material("Sky", colour))
        mesh.CreateNormalsAttr([Gf.Vec3f(0, 1, 0)])
        mesh.SetNormalsInterpolation(UsdGeom.Tokens.constant)

    def place(
        self, path: str, at: tuple[float, float, float], *, turn: float = 0.0, scale: float = 1.0, kind: str = "Xform"
    ) -> UsdGeom.Xformable:
        """A prim under /World, moved to `at`, turned about the up axis by degrees, scaled."""
        xform = UsdGeom.Xformable(self.stage.DefinePrim(f"/World/{path}", kind))
        xform.AddTranslateOp().Set(Gf.Vec3d(*at))
        if turn:
            up_is_y = UsdGeom.GetStageUpAxis(self.stage) == UsdGeom.Tokens.y
            (xform.AddRotateYOp() if up_is_y else xform.AddRotateZOp()).Set(turn)
        if scale != 1.0:
            xform.AddScaleOp().Set(Gf.Vec3f(scale, scale, scale))
        return xform

    def instance(
        self, path: str, prototype: str, at: tuple[float, float, float], *, turn: float = 0.0, scale: float = 1.0
    ) -> UsdGeom.Xformable:
        """A native instance of what is under /World/<prototype>."""
        xform = self.place(path, at, turn=turn, scale=scale)
        xform.GetPrim().GetReferences().AddInternalReference(f"/World/{prototype}")
        xform.GetPrim().SetInstanceable(True)
        return xform

    def copy(
        self, path: str, prototype: str, at: tuple[float, float, float], scale: float, material: UsdShade.Material
    ) -> None:
        """A mesh that refers to the points of /World/<prototype>, with its own place and material."""
        xform = self.place(path, at, scale=scale, kind="Mesh")
        xform.GetPrim().GetReferences().AddInternalReference(f"/World/{prototype}")
        UsdShade.MaterialBindingAPI.Apply(xform.GetPrim()).Bind(material)

    def scatter(
        self, path: str, prototypes: list[str], which: NDArray[np.int64], at: Floats, turns: Floats, scales: Floats
    ) -> None:
        """A point instancer.

        Args:
            path: Under /World.
            prototypes: Paths under /World.
            which: Prototype of each instance, int64 [M].
            at: Positions, float64 [M, 3].
            turns: Unit quaternions, real part first, float64 [M, 4].
            scales: float64 [M].
        """
        instancer = UsdGeom.PointInstancer.Define(self.stage, f"/World/{path}")
        instancer.CreatePrototypesRel().SetTargets([Sdf.Path(f"/World/{p}") for p in prototypes])
        instancer.CreateProtoIndicesAttr(Vt.IntArray.FromNumpy(which.astype(np.int32)))
        instancer.CreatePositionsAttr(Vt.Vec3fArray.FromNumpy(at.astype(np.float32)))
        instancer.CreateOrientationsAttr([Gf.Quath(*(float(x) for x in turn)) for turn in turns])
        instancer.CreateScalesAttr(Vt.Vec3fArray.FromNumpy(np.repeat(scales[:, None], 3, axis=1).astype(np.float32)))

    def prototypes(self, path: str) -> None:
        """Makes /World/<path> a scope that is never drawn where it stands: an `over` when the stage is saved.

        Of a class, Storm draws nothing where a point instancer has its prototypes.
        """
        self._undrawn.append(self.stage.CreateClassPrim(f"/World/{path}"))

    def camera(
        self, name: str, eye: tuple[float, float, float], target: tuple[float, float, float], fov: float = 40.0
    ) -> None:
        """A perspective camera with a vertical field of view in degrees and the stage's own up direction."""
        camera = UsdGeom.Camera.Define(self.stage, f"/World/Cameras/{name}")
        up = Gf.Vec3d(0, 1, 0) if UsdGeom.GetStageUpAxis(self.stage) == UsdGeom.Tokens.y else Gf.Vec3d(0, 0, 1)
        look = Gf.Matrix4d().SetLookAt(Gf.Vec3d(*eye), Gf.Vec3d(*target), up)
        camera.AddTransformOp().Set(look.GetInverse())
        focal = 50.0
        vertical = 2.0 * focal * float(np.tan(np.radians(0.5 * fov)))
        camera.CreateFocalLengthAttr(focal)
        camera.CreateVerticalApertureAttr(vertical)
        camera.CreateHorizontalApertureAttr(vertical * 1430.0 / 960.0)
