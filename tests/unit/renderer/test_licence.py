"""Where a stage states its licence, and what of a glTF file's reaches the stage that it is converted to."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import trimesh
from pxr import Sdf

from renderer.convert import stage_file
from renderer.convert_meshes import convert_meshes
from renderer.usd.licence import authored_licence

LAYER = """#usda 1.0
({layer}
    defaultPrim = "World"
)
def Xform "World" ({prim}
)
{{
}}
"""


@pytest.mark.parametrize(
    ("layer", "prim", "expected"),
    [
        ("", "", ""),
        ('customLayerData = { string license = "CC0" }', "", "CC0"),
        ('customLayerData = { string Licence = "CC-BY-4.0"\n string author = "Jane" }', "", "CC-BY-4.0; Jane"),
        (
            'customLayerData = { dictionary asset = { string copyright = "(c) Jane"\n string license = "MIT" } }',
            "",
            "MIT; (c) Jane",
        ),
        ("", 'assetInfo = { string license = "MIT" }', "MIT"),
        ('customLayerData = { string license = "CC0" }', 'customData = { string license = "MIT" }', "CC0"),
        ("customLayerData = { int license = 3 }", "", ""),
    ],
)
def test_metadata_of_a_stage(tmp_path: Path, layer: str, prim: str, expected: str) -> None:
    file = tmp_path / "a.usda"
    file.write_text(LAYER.format(layer=layer, prim=prim), encoding="utf-8")
    assert authored_licence(file) == expected


def test_a_file_that_is_no_layer_states_nothing(tmp_path: Path) -> None:
    file = tmp_path / "a.usda"
    file.write_text("nothing", encoding="utf-8")
    assert authored_licence(file) == ""


@pytest.mark.parametrize("is_uploaded", [True, False])
def test_a_gltf_file_keeps_its_licence(tmp_path: Path, is_uploaded: bool) -> None:
    source = tmp_path / "box.glb"

    def state(tree: dict[str, object]) -> None:
        asset = json.loads(json.dumps(tree["asset"]))
        tree["asset"] = {**asset, "copyright": "2024 Jane", "extras": {"license": "CC-BY-4.0"}}

    content = trimesh.exchange.gltf.export_glb(trimesh.Scene(trimesh.creation.box()), tree_postprocessor=state)
    source.write_bytes(content)
    if is_uploaded:
        stage = stage_file(tmp_path, source.name, tmp_path / "cache")
    else:
        stage = tmp_path / "box.usdc"
        convert_meshes(source, stage)
    assert authored_licence(stage) == "CC-BY-4.0; 2024 Jane"
    assert Sdf.Layer.FindOrOpen(str(stage)).customLayerData == {"licence": "CC-BY-4.0; 2024 Jane"}
