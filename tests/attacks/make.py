"""Writes accept/, reject/ and expected.json: `python tests/attacks/make.py`; the same bytes each time.

Every attack points at CANARY or at `../canary/`, which a test places and watches, or at PORT, where it listens.
"""

from __future__ import annotations

import json
import shutil
import struct
import sys
import tempfile
import zlib
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from attacks import glbs, packages
from pxr import Sdf, Usd, UsdGeom

HERE = Path(__file__).parent
CANARY = "/tmp/diaphane-canary"
PORT = 47391

MESH = """def Mesh "Sheet" (METADATA) {
    int[] faceVertexCounts = [3]
    int[] faceVertexIndices = [0, 1, 2]
    point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]
    float[] primvars:displayOpacity = [0.5]
    PROPERTIES
}
"""


def mesh(properties: str = "", metadata: str = "") -> str:
    """A triangle, with more in it."""
    return MESH.replace("METADATA", metadata).replace("PROPERTIES", properties)


def usda(body: str = "", metadata: str = "", sheet: str = "") -> str:
    """A text layer that can be drawn, with more in it."""
    return f'#usda 1.0\n(\n    defaultPrim = "Sheet"\n{metadata}\n)\n{sheet or mesh()}\n{body}\n'


def prim(metadata: str, body: str = "") -> str:
    """A text layer with a prim that has such metadata."""
    return usda(f'def "Attack" (\n{metadata}\n) {{\n{body}\n}}')


def attribute(line: str) -> str:
    """A text layer with such an attribute."""
    return usda(f'def "Attack" {{\n{line}\n}}')


def variant(line: str, chosen: str = "on") -> str:
    """A text layer whose variant `on` has such metadata."""
    return usda(
        f'def "Attack" (\nprepend variantSets = "v"\nvariants = {{\nstring v = "{chosen}"\n}}\n) {{\n'
        f'variantSet "v" = {{\n"on" (\n{line}\n) {{\n}}\n"off" {{\n}}\n}}\n}}'
    )


def clips(lines: str) -> str:
    """A text layer with value clips."""
    start = "startTimeCode = 0\nendTimeCode = 4"
    inside = f'clips = {{\ndictionary default = {{\n{lines}\nstring primPath = "/Sheet"\n}}\n}}'
    return usda(f'def "Attack" (\n{inside}\n) {{\ndouble x\n}}', start)


ENDLESS = "double templateStartTime = 0\ndouble templateEndTime = 1e9\ndouble templateStride = 1e-9"
ACTIVE = "double2[] active = [(0, 0)]\ndouble2[] times = [(0, 0), (4, 4)]"
TEMPLATE = "double templateStartTime = 0\ndouble templateEndTime = 2\ndouble templateStride = 1"
OUT = "../canary/canary.usda"


def chunk(kind: bytes, data: bytes) -> bytes:
    """A chunk of a PNG."""
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def palette(colours: bytes | None, kind: int = 3, depth: int = 8) -> bytes:
    """A PNG with the indices of a palette, with or without the palette."""
    header = chunk(b"IHDR", struct.pack(">IIBBBBB", 2, 2, depth, kind, 0, 0, 0))
    given = b"" if colours is None else chunk(b"PLTE", colours)
    pixels = chunk(b"IDAT", zlib.compress(b"\0\0\1" * 2, 9))
    return b"\x89PNG\r\n\x1a\n" + header + given + pixels + chunk(b"IEND", b"")


def png(width: int = 2, height: int = 2, size: tuple[int, int] | None = None) -> bytes:
    """A grey PNG; its header may claim another size."""
    rows = zlib.compress((b"\0" + b"\x80" * width) * height, 9)
    header = struct.pack(">IIBBBBB", *(size or (width, height)), 8, 0, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", rows) + chunk(b"IEND", b"")


def jpeg(width: int, height: int) -> bytes:
    """The beginning of a JPEG of that size."""
    return b"\xff\xd8\xff\xe0\x00\x04\x00\x00\xff\xc0" + struct.pack(">HBHHB", 11, 8, height, width, 1) + b"\1\x11\0"


TEXTURED = """def Material "Paint" {
    token outputs:surface.connect = </Paint/Surface.outputs:surface>
    def Shader "Surface" {
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor.connect = </Paint/Image.outputs:rgb>
        token outputs:surface
    }
    def Shader "Image" {
        uniform token info:id = "UsdUVTexture"
        asset inputs:file = @FILE@
        float3 outputs:rgb
    }
}
"""


def textured(file: str) -> str:
    """A text layer that samples an image."""
    bound = mesh("rel material:binding = </Paint>", 'prepend apiSchemas = ["MaterialBindingAPI"]')
    return usda(TEXTURED.replace("FILE", file), sheet=bound)


def bomb(arc: str, levels: int = 6, width: int = 8) -> str:
    """A small layer that composes to width ** levels prims."""
    lines = ['#usda 1.0\n(\ndefaultPrim = "L0"\n)']
    for level in range(levels):
        kids = "".join(f'def "K{i}" ({arc} = </L{level + 1}>) {{}}\n' for i in range(width))
        lines.append(f'def "L{level}" {{\n{kids}}}')
    return "\n".join([*lines, f'def "L{levels}" {{\n{mesh()}}}\n'])


def doubled(levels: int) -> str:
    """A chain of prims each of which refers to the next one by two ways: 2 ** levels ways in all."""
    return usda(
        "\n".join(
            f'def "V{i}" (\nreferences = </V{i + 1}>\n'
            'prepend variantSets = "v"\nvariants = {\nstring v = "a"\n}\n) {\n'
            f'variantSet "v" = {{\n"a" (\nreferences = </V{i + 1}>\n) {{\n}}\n}}\n}}'
            for i in range(levels)
        )
    )


def chain(length: int) -> dict[str, bytes]:
    """Layers each of which refers to the next."""
    layers = {f"l{i}.usda": prim(f"references = @./l{i + 1}.usda@").encode() for i in range(length)}
    return {**layers, f"l{length}.usda": usda().encode()}


def instancers(levels: int, copies: int, faces: int = 1) -> str:
    """Point instancers in each other, of a mesh of three points."""
    several = mesh().replace("[3]", f"[{', '.join(['3'] * faces)}]")
    several = several.replace("[0, 1, 2]", f"[{', '.join(['0, 1, 2'] * faces)}]")
    inner = 'def Scope "P" {\n' + several + "}\n"
    for _ in range(levels):
        zeros = ", ".join(["0"] * copies)
        places = ", ".join(["(0, 0, 0)"] * copies)
        inner = (
            f'def PointInstancer "P" {{\nrel prototypes = <P>\nint[] protoIndices = [{zeros}]\n'
            f"point3f[] positions = [{places}]\n{inner}}}\n"
        )
    return f'#usda 1.0\ndef "World" {{\n{inner}}}\n'


def crate(text: str) -> bytes:
    """A text layer in binary."""
    layer = Sdf.Layer.CreateAnonymous(".usda")
    layer.ImportFromString(text)
    return exported(layer)


def exported(layer: Sdf.Layer) -> bytes:
    """The bytes of a layer as .usdc."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "layer.usdc"
        layer.Export(str(file))
        return file.read_bytes()


def mistyped() -> bytes:
    """A crate whose attribute says float and holds a file's name."""
    layer = Sdf.Layer.CreateAnonymous(".usda")
    layer.ImportFromString(usda())
    spec = Sdf.AttributeSpec(layer.GetPrimAtPath("/Sheet"), "inputs:file", Sdf.ValueTypeNames.Float)
    spec.SetInfo("default", Sdf.AssetPath(OUT))
    return exported(layer)


MTLX = '<?xml version="1.0"?>\n{head}<materialx version="1.38">\n{body}\n</materialx>\n'
WITH_MTLX = prim("references = @./look.mtlx@").encode()


def mtlx(body: str, head: str = "") -> dict[str, bytes]:
    """A scene with a MaterialX document."""
    return {"scene.usda": WITH_MTLX, "look.mtlx": MTLX.format(head=head, body=body).encode()}


LAUGHS = (
    "<!DOCTYPE z [<!ENTITY a0 'ha'>" + "".join(f"<!ENTITY a{i} '{f'&a{i - 1};' * 10}'>" for i in range(1, 10)) + "]>"
)
FILE_INPUT = '<image name="i" type="color3"><input name="file" type="filename" value="{}"/></image>'

Upload = str | bytes | dict[str, bytes]
"""A text layer, or a file, or several files."""


def rejected() -> dict[str, tuple[str, Upload]]:
    """Slug and upload of every attack that the gate refuses, by file name."""
    outside = {
        "reference-absolute.usda": prim(f"references = @{CANARY}/canary.usda@"),
        "reference-parent.usda": prim(f"references = @{OUT}@"),
        "reference-parent-in-the-middle.usda": prim("references = @./a/../../canary/canary.usda@"),
        "reference-removed.usda": prim(f"delete references = @{OUT}@"),
        "reference-three-at-signs.usda": prim(f"references = @@@{OUT}@@@"),
        "reference-of-pipe.usda": prim("references = @../canary/pipe.usda@"),
        "reference-home.usda": prim("references = @~/canary.usda@"),
        "reference-drive.usda": prim("references = @C:/canary.usda@"),
        "reference-drive-backslash.usda": prim("references = @C:\\canary.usda@"),
        "reference-share.usda": prim("references = @\\\\127.0.0.1\\canary\\canary.usda@"),
        "reference-backslash.usda": prim("references = @..\\canary\\canary.usda@"),
        "reference-custom-data.usda": prim(f"references = </Sheet> (customData = {{\nasset a = @{OUT}@\n}})"),
        "sublayer-absolute.usda": usda("", f"subLayers = [@{CANARY}/canary.usda@]"),
        "sublayer-parent.usda": usda("", f"subLayers = [@{OUT}@]"),
        "sublayer-offset.usda": usda("", f"subLayers = [@{OUT}@ (offset = 1; scale = 2)]"),
        "payload-parent.usda": prim(f"payload = @{OUT}@</Sheet>"),
        "variant-payload.usda": variant(f"payload = @{OUT}@"),
        "variant-not-chosen.usda": variant(f"references = @{OUT}@", "off"),
        "clip-assets.usda": clips(f"asset[] assetPaths = [@{OUT}@]\nasset manifestAssetPath = @./m.usda@\n{ACTIVE}"),
        "clip-manifest.usda": clips(f"asset[] assetPaths = [@./c.usda@]\nasset manifestAssetPath = @{OUT}@\n{ACTIVE}"),
        "clip-template.usda": clips(f'string templateAssetPath = "../canary/canary.##.usda"\n{TEMPLATE}'),
        "texture-absolute.usda": textured(f"{CANARY}/canary.png"),
        "texture-parent.usda": textured("../canary/canary.png"),
        "texture-tiles.usda": textured("../canary/canary.<UDIM>.png"),
        "texture-time-sample.usda": attribute("asset a.timeSamples = {\n0: @../canary/canary.png@\n}"),
        "texture-array.usda": attribute(f"asset[] a = [@./b.png@, @{CANARY}/canary.png@]"),
        "texture-in-float.usdc": mistyped(),
        "texture-in-crate.usdc": crate(textured("../canary/canary.png")),
        "custom-data.usda": prim(f"customData = {{\ndictionary d = {{\nasset[] a = [@{OUT}@]\n}}\n}}"),
        "custom-layer-data.usda": usda("", f"customLayerData = {{\nasset a = @{CANARY}/canary.usda@\n}}"),
        "asset-info.usda": prim(f"assetInfo = {{\nasset identifier = @{OUT}@\n}}"),
        "relationship-custom-data.usda": attribute(f"rel r (\ncustomData = {{\nasset a = @{OUT}@\n}}\n)"),
        "materialx-texture.usdz": packages.plain(
            {k.replace("scene", "a"): v for k, v in mtlx(FILE_INPUT.format("../../canary/canary.png")).items()}
        ),
        "materialx-prefix.usdz": packages.plain(mtlx(f'<image name="i" fileprefix="{CANARY}/"/>')),
    }
    expressions = {
        "expression-reference.usda": prim('references = @`"../canary/canary.usda"`@'),
        "expression-sublayer.usda": usda("", 'subLayers = [@`"../canary/canary.usda"`@]'),
        "expression-texture.usda": attribute('asset a = @`"../canary/canary.png"`@'),
        "expression-variant.usda": variant("customData = {\nint i = 1\n}", "`${V}`"),
        "expression-variables.usda": usda("", f'expressionVariables = {{\nstring P = "{OUT}"\n}}'),
        "expression-environment.usda": prim("references = @${HOME}/canary.usda@"),
        "expression-override.usdz": packages.plain(
            {
                "root.usda": usda(
                    metadata=f'expressionVariables = {{\nstring P = "{CANARY}/canary.usda"\n}}',
                    sheet=mesh(metadata="references = @./inner.usda@"),
                ).encode(),
                "inner.usda": prim('references = @`"${P}"`@').encode(),
            }
        ),
    }
    urls = {
        "url-http.usda": prim(f"references = @http://127.0.0.1:{PORT}/canary.usda@"),
        "url-texture.usda": textured(f"http://127.0.0.1:{PORT}/canary.png"),
        "url-file.usda": prim(f"references = @file://{CANARY}/canary.usda@"),
        "url-capitals.usda": prim(f"payload = @FILE:{CANARY}/canary.usda@"),
        "url-store.usda": usda("", "subLayers = [@s3://canary/canary.usda@]"),
    }
    formats = {
        "format-arguments.usda": prim("references = @./a.usda:SDF_FORMAT_ARGS:target=usd@"),
        "format-arguments-outside.usda": prim(f"references = @{OUT}:SDF_FORMAT_ARGS:target=usd@"),
        "format-memory.usda": prim("references = @anon:0x1234:a.usda@"),
        "format-alembic.usda": prim("payload = @./a.abc@"),
        "format-draco.usda": prim("payload = @./a.drc@"),
        "format-none.usda": usda("", "subLayers = [@./a@]"),
        "format-text-as-crate.usdc": usda(),
        "format-crate-as-text.usda": crate(usda()),
        "format-script-in-texture.usdz": packages.plain(
            {"a.usda": textured("./run.py").encode(), "run.py": b"print('canary')\n"}
        ),
        "materialx-include.usdz": packages.plain(
            mtlx(f'<xi:include xmlns:xi="http://www.w3.org/2001/XInclude" href="{CANARY}/canary.mtlx"/>')
        ),
        "materialx-entity.usdz": packages.plain(
            mtlx("&x;", f'<!DOCTYPE m [<!ENTITY x SYSTEM "file://{CANARY}/canary.txt">]>')
        ),
        "materialx-laughs.usdz": packages.plain(mtlx("&a9;", LAUGHS)),
        "materialx-utf16.usdz": packages.plain(
            {"scene.usda": WITH_MTLX, "look.mtlx": MTLX.format(head=LAUGHS, body="&a9;").encode("utf-16")}
        ),
    }
    names = {
        "name-encoded.usda": prim("references = @%2e%2e/canary/canary.usda@"),
        "name-encoded-twice.usda": prim("references = @%252e%252e/canary/canary.usda@"),
        "name-fullwidth.usda": prim("references = @\uff0e\uff0e/canary/canary.usda@"),
        "name-leader.usda": prim("references = @\u2025/canary/canary.usda@"),
        "name-slash-lookalike.usda": prim("references = @a\uff0f..\uff0fcanary.usda@"),
        "name-right-to-left.usda": prim("references = @a\u202eadsu.b@"),
        "name-zero-width.usda": prim("references = @.\u200b./canary/canary.usda@"),
        "name-package-in-package.usda": prim("references = @./a.usdz[b.usdz[c.usda]]@"),
    }
    sizes = {
        "bomb-prims-references.usda": bomb("references"),
        "bomb-prims-inherits.usda": bomb("inherits"),
        "bomb-prims-payloads.usda": bomb("payload"),
        "bomb-prims-specializes.usdc": crate(bomb("specializes")),
        "bomb-ways.usda": doubled(30),
        "bomb-prims-huge.usda": bomb("references", 60, 8),
        "bomb-clips.usda": clips(f'string templateAssetPath = "./c.##.usda"\n{ENDLESS}'),
        "bomb-clips-in-layers.usdz": packages.plain(
            {
                "a.usda": usda(
                    'over "Attack" (\nclips = {\ndictionary default = {\ndouble templateStride = 1e-9\n}\n}\n) {\n}',
                    "subLayers = [@./b.usda@]",
                ).encode(),
                "b.usda": clips('string templateAssetPath = "./c.##.usda"\n' + TEMPLATE).encode(),
            }
        ),
        "bomb-braces.usda": "#usda 1.0\n" + 'def "a" {\n' * 3000 + "}\n" * 3000,
        "bomb-brackets.usda": attribute("float x = " + "(" * 20000 + ")" * 20000),
        "bomb-dictionaries.usda": usda("", "customLayerData = {\n" + "dictionary d = {\n" * 3000 + "}\n" * 3000 + "}"),
    }
    textures = {
        "texture-exr.usdz": packages.plain(
            {"a.usda": textured("./t.exr").encode(), "t.exr": b"\x76\x2f\x31\x01\2\0\0\0"}
        ),
        "texture-exr-as-png.usdz": packages.plain(
            {"a.usda": textured("./t.png").encode(), "t.png": b"\x76\x2f\x31\x01\2\0\0\0"}
        ),
        "texture-postscript.usdz": packages.plain(
            {"a.usda": textured("./t.png").encode(), "t.png": b"%!PS-Adobe-3.0 EPSF-3.0\n(canary) run\n"}
        ),
        "texture-gif.usdz": packages.plain({"a.usda": textured("./t.gif").encode(), "t.gif": b"GIF89a\1\0\1\0\0\0\0;"}),
        "texture-bomb.usdz": packages.plain(
            {"a.usda": textured("./t.png").encode(), "t.png": png(size=(60000, 60000))}
        ),
        "texture-jpeg-bomb.usdz": packages.plain({"a.usda": textured("./t.jpg").encode(), "t.jpg": jpeg(65535, 65535)}),
        "texture-cut.usdz": packages.plain({"a.usda": textured("./t.png").encode(), "t.png": png()[:20]}),
        "texture-no-palette.usdz": packages.plain({"a.usda": textured("./t.png").encode(), "t.png": palette(None)}),
        "texture-odd-palette.usdz": packages.plain({"a.usda": textured("./t.png").encode(), "t.png": palette(b"1234")}),
        "texture-odd-depth.usdz": packages.plain(
            {"a.usda": textured("./t.png").encode(), "t.png": palette(b"123456", depth=16)}
        ),
        "texture-no-image.usdz": packages.plain({"a.usda": textured("./t.png").encode(), "t.png": b"canary"}),
    }
    damaged = {
        "damaged-empty.usda": b"",
        "damaged-text.usda": "#usda 1.0\ndef Mesh {{{ canary\n",
        "damaged-crate-cut.usdc": crate(usda())[:200],
        "damaged-crate-offset.usdc": _overwritten(crate(usda()), 16, b"\xff" * 8),
        "damaged-crate-counts.usdc": _overwritten(crate(usda()), 120, b"\xff" * 64),
        "damaged-cookie.usd": b"canary",
    }
    layers = {f"l{i}.usda": usda().encode() for i in range(257)}
    found: dict[str, tuple[str, Upload]] = {}
    for slug, cases in (
        ("scene-path-outside", outside),
        ("scene-expression", expressions),
        ("scene-url", urls),
        ("scene-format", formats),
        ("scene-file-name", names),
        ("scene-too-large", sizes),
        ("scene-texture", textures),
        ("scene-damaged", damaged),
    ):
        found.update({name: (slug, upload) for name, upload in cases.items()})
    found["damaged-cookie.usd"] = ("scene-format", b"canary")
    found["layers-many.usdz"] = ("scene-too-many-layers", packages.plain(layers))
    found["layers-deep.usdz"] = ("scene-too-many-layers", packages.plain(chain(40)))
    found.update(packages.attacks(usda().encode(), prim(f"references = @../{OUT}@").encode(), png()))
    found.update(glbs.attacks(CANARY, PORT, png()))
    return found


def rejected_by_child() -> dict[str, tuple[str, Upload]]:
    """Slug and upload of what the gate cannot see."""
    nan = usda().replace("(1, 0, 0)", "(nan, 0, 0)")
    far = (
        "matrix4d xformOp:transform = ((1e300,0,0,0),(0,1e300,0,0),(0,0,1,0),(0,0,0,1))\n"
        'uniform token[] xformOpOrder = ["xformOp:transform"]'
    )
    return {
        "geometry-none.usda": ("scene-no-geometry", '#usda 1.0\ndef Xform "A" {}\n'),
        "geometry-invisible.usda": ("scene-no-geometry", usda(sheet=mesh('token visibility = "invisible"'))),
        "geometry-nan.usda": ("scene-damaged", nan),
        "geometry-far.usda": ("scene-damaged", usda(sheet=mesh(far))),
        "bomb-instancers.usda": ("scene-too-large", instancers(4, 120)),
        "bomb-copies.usda": ("scene-too-large", instancers(3, 300)),
        "bomb-triangles.usda": ("scene-too-large", instancers(3, 130, 30)),
    }


def accepted() -> dict[str, Upload]:
    """Uploads that are in order."""
    ball = Usd.Stage.CreateInMemory()
    UsdGeom.Sphere.Define(ball, "/Ball")
    moving = (
        "double3 xformOp:translate.timeSamples = {\n0: (0, 0, 0),\n9: (1, 0, 0)\n}\n"
        'uniform token[] xformOpOrder = ["xformOp:translate"]'
    )
    instanced = usda(
        'def PointInstancer "Many" {\nrel prototypes = </Many/Kid>\nint[] protoIndices = [0, 0]\n'
        f'point3f[] positions = [(0, 0, 0), (2, 0, 0)]\ndef Scope "Kid" {{\n{mesh()}}}\n}}'
    )
    return {
        "mesh.usda": usda(),
        "mesh.usdc": crate(usda()),
        "text.usd": usda(),
        "crate.usd": crate(usda()),
        "ball.usdc": exported(ball.GetRootLayer()),
        "package.usdz": packages.plain({"a.usda": usda().encode()}),
        "package-crate.usdz": packages.plain({"a.usdc": crate(usda())}),
        "package-texture.usdz": packages.plain({"a.usda": textured("./t/b.png").encode(), "t/b.png": png()}),
        "package-palette.usdz": packages.plain({"a.usda": textured("t.png").encode(), "t.png": palette(b"123456")}),
        "package-search-path.usdz": packages.plain({"a.usda": textured("t/b.png").encode(), "t/b.png": png()}),
        "package-layers.usdz": packages.plain(
            {
                "a.usda": usda("", "subLayers = [@./below/b.usda@]").encode(),
                "below/b.usda": prim("payload = @./c.usda@").encode(),
                "below/c.usda": usda().encode(),
            }
        ),
        "package-materialx.usdz": packages.plain({**mtlx(FILE_INPUT.format("t.png")), "t.png": png()}),
        "package-notes.usdz": packages.plain({"a.usda": usda().encode(), "LICENSE.txt": b"public domain\n"}),
        "missing-reference.usda": prim("references = @./gone.usda@"),
        "missing-texture.usda": textured("./gone.png"),
        "missing-exr.usda": attribute("asset a = @./sky.exr@"),
        "tiles.usda": textured("./t.<UDIM>.png"),
        "variants.usda": variant("references = </Sheet>"),
        "inherits.usda": prim("inherits = </Sheet>"),
        "references-itself.usda": prim("references = </Sheet>"),
        "references-cycle.usda": prim("references = @./references-cycle.usda@</Attack>"),
        "relocates.usda": usda("", "relocates = {\n</A/b>: </A/c>\n}"),
        "clips.usda": clips(f"asset[] assetPaths = [@./c.usda@]\nasset manifestAssetPath = @./m.usda@\n{ACTIVE}"),
        "clips-template.usda": clips(f'string templateAssetPath = "./c.##.usda"\n{TEMPLATE}'),
        "time-samples.usda": usda(metadata="startTimeCode = 0\nendTimeCode = 9", sheet=mesh(moving)),
        "instancer.usda": instanced,
        "instances.usda": usda(
            "\n".join(f'def "I{i}" (\ninstanceable = true\nreferences = </Sheet>\n) {{}}' for i in range(20))
        ),
        "words.usda": usda(
            "",
            'doc = """see http://example.com, ../there, `code`, ${X} and ((((( {{{"""\n'
            'customLayerData = {\nstring path = "/etc/passwd"\n}',
        ),
        "accents.usda": textured("./d\u00e9cor \u6728.png"),
        "nested.usda": usda("".join(f'def Xform "N{i}" {{\n' for i in range(60)) + "}\n" * 60),
        **glbs.good(png()),
    }


def _overwritten(data: bytes, at: int, by: bytes) -> bytes:
    return data[:at] + by + data[at + len(by) :]


def _write(folder: Path, uploads: dict[str, Upload]) -> None:
    for name, upload in uploads.items():
        data = upload.encode() if isinstance(upload, str) else upload
        assert isinstance(data, bytes)
        (folder / name).write_bytes(data)


def main() -> None:
    """Writes everything anew."""
    for name in ("accept", "reject"):
        shutil.rmtree(HERE / name, ignore_errors=True)
        (HERE / name).mkdir()
    gate, child = rejected(), rejected_by_child()
    _write(HERE / "accept", accepted())
    _write(HERE / "reject", {name: upload for name, (_, upload) in {**gate, **child}.items()})
    expected = {name: {"slug": slug, "stage": "gate"} for name, (slug, _) in gate.items()}
    expected.update({name: {"slug": slug, "stage": "child"} for name, (slug, _) in child.items()})
    text = json.dumps(expected, indent=1, sort_keys=True)
    (HERE / "expected.json").write_text(f"{text}\n", encoding="utf-8")


if __name__ == "__main__":
    main()
