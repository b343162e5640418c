"""The forms that no OpenGL runs here, and float16 that it does not have: WGSL, HLSL and GLSL through Vulkan; and zink.

HLSL and GLSL become SPIR-V in the Khronos reference compiler; wgpu hands everything to Mesa's software Vulkan driver.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from support import webgpu
from support.drivers import ROOT, environment, lavapipe_installed
from support.training import export_random, random_weights, real_features

from evaluation.stress.gl_drivers import ZINK
from renderer.features import TEXELS
from schemas.bundle import (
    GLSL,
    GLSL_HALF,
    HLSL,
    UBO,
    UBO_DATA,
    UBO_HALF,
    UBO_HALF_DATA,
    WGSL,
    WGSL_HALF,
    ParityReport,
    load_manifest,
)
from trainer.half import half_outputs
from trainer.parity import torch_outputs

pytestmark = [
    pytest.mark.skipif(not lavapipe_installed(), reason=f"there is no Vulkan driver: apt-get install {ZINK.packages}"),
    pytest.mark.skipif(find_spec("wgpu") is None, reason="there is no wgpu: pip install wgpu"),
    pytest.mark.skipif(shutil.which("glslangValidator") is None, reason="apt-get install glslang-tools"),
]

WEIGHTS = random_weights(6, hidden=(12, 8))
OUTPUTS = len(WEIGHTS.outputs)

HLSL_MAIN = f"""
StructuredBuffer<float> inputs : register(t0);
RWStructuredBuffer<float> outputs : register(u1);

[numthreads({webgpu.GROUP}, 1, 1)]
void main(uint3 id : SV_DispatchThreadID) {{
    uint count, stride;
    outputs.GetDimensions(count, stride);
    if (id.x * DIAPHANE_OUTPUTS >= count) return;
    float x[DIAPHANE_FEATURES];
    for (uint i = 0; i < DIAPHANE_FEATURES; ++i) x[i] = inputs[id.x * DIAPHANE_FEATURES + i];
    DiaphaneAnswer found = diaphane_predict(x);
    for (uint j = 0; j < DIAPHANE_OUTPUTS; ++j) outputs[id.x * DIAPHANE_OUTPUTS + j] = found.y[j];
}}
"""

GLSL_MAIN = f"""
layout(local_size_x = {webgpu.GROUP}) in;
layout(std430, binding = 0) readonly buffer Inputs {{ float inputs[]; }};
layout(std430, binding = 1) writeonly buffer Outputs {{ float outputs[]; }};

void main() {{
    int row = int(gl_GlobalInvocationID.x);
    if (row * DIAPHANE_OUTPUTS >= outputs.length()) return;
    float x[DIAPHANE_FEATURES];
    for (int i = 0; i < DIAPHANE_FEATURES; ++i) x[i] = inputs[row * DIAPHANE_FEATURES + i];
    DiaphaneAnswer found = diaphane_predict(x);
    for (int j = 0; j < DIAPHANE_OUTPUTS; ++j) outputs[row * DIAPHANE_OUTPUTS + j] = found.y[j];
}}
"""

FLOAT16 = "#extension GL_EXT_shader_explicit_arithmetic_types_float16 : require\n#define DIAPHANE_FLOAT16\n"

SUMS_MAIN = f"""
    var s: array<vec4f, {TEXELS}>;
    for (var i = 0u; i < {TEXELS}u; i++) {{
        let first = (row * {TEXELS}u + i) * 4u;
        s[i] = vec4f(inputs[first], inputs[first + 1u], inputs[first + 2u], inputs[first + 3u]);
    }}
    let x = diaphane_features(s);
    for (var i = 0u; i < DIAPHANE_FEATURES; i++) {{
        outputs[row * DIAPHANE_FEATURES + i] = x[i];
    }}
}}
"""


@dataclass(frozen=True)
class Compared:
    """A bundle, inputs of its network, what torch answers to them, and what the forms do."""

    folder: Path
    features: NDArray[np.float32]
    inputs: NDArray[np.float32]
    truth: NDArray[np.float32]
    found: dict[str, NDArray[np.float32]]

    def relative(self, name: str) -> float:
        """The largest difference, relative to max(1, |value|)."""
        return float((np.abs(self.found[name] - self.truth) / np.maximum(1.0, np.abs(self.truth))).max())

    def scaled(self, name: str, other: NDArray[np.float32]) -> float:
        """The largest difference to some outputs, relative to their scale."""
        return float((np.abs(self.found[name] - other) / np.maximum(1.0, np.abs(self.truth).max(axis=0))).max())


def spirv(path: Path, text: str, *options: str) -> bytes:
    """A compute shader in GLSL or, with `-D`, HLSL, compiled by the reference compiler."""
    path.write_text(text)
    target = path.with_suffix(".spv")
    command = ["glslangValidator", "-V", "--target-env", "vulkan1.1", "-S", "comp", "-e", "main", *options]
    done = subprocess.run([*command, "-o", str(target), str(path)], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout[-3000:]
    return target.read_bytes()


@pytest.fixture(scope="module")
def compared(tmp_path_factory: pytest.TempPathFactory) -> Compared:
    weights, features = WEIGHTS, real_features(100_000, 1)
    folder, work = tmp_path_factory.mktemp("bundle"), tmp_path_factory.mktemp("work")
    export_random(folder, weights, features)
    text = {name: (folder / name).read_text() for name in (GLSL, GLSL_HALF, HLSL, UBO, UBO_HALF, WGSL, WGSL_HALF)}
    shaders = {name: webgpu.Shader(text[name] + webgpu.PREDICT, OUTPUTS) for name in (WGSL, WGSL_HALF)}
    shaders[HLSL] = webgpu.Shader(spirv(work / HLSL, text[HLSL] + HLSL_MAIN, "-D"), OUTPUTS)
    for name, data in ((GLSL, None), (GLSL_HALF, None), (UBO, UBO_DATA), (UBO_HALF, UBO_HALF_DATA)):
        extension = FLOAT16 if "half" in name else ""
        code = f"#version 450\n{extension}#define DIAPHANE_BINDING 2\n{text[name]}{GLSL_MAIN}"
        shaders[name] = webgpu.Shader(spirv(work / name, code), OUTPUTS, (folder / data).read_bytes() if data else None)
    inputs = np.ascontiguousarray(features[:, weights.columns])
    found = webgpu.run(work, shaders, inputs)
    return Compared(folder, features, inputs, torch_outputs(weights, inputs), found)


@pytest.mark.parametrize("name", [WGSL, HLSL, GLSL, UBO])
def test_forms_in_float32_agree_with_torch(compared: Compared, name: str) -> None:
    assert 0.0 < compared.relative(name) <= 1e-5


@pytest.mark.parametrize("name", [WGSL_HALF, GLSL_HALF, UBO_HALF])
def test_forms_in_float16_are_float16_and_near_torch(compared: Compared, name: str) -> None:
    assert 1e-5 < compared.scaled(name, compared.truth) <= 1e-2


def test_wgsl_in_float16_rounds_as_its_twin_in_numpy(compared: Compared) -> None:
    assert compared.scaled(WGSL_HALF, half_outputs(WEIGHTS, compared.inputs)) <= 1e-5


@pytest.mark.skipif(shutil.which("dxc") is None, reason="there is no dxc in the PATH: DirectX Shader Compiler")
def test_hlsl_agrees_with_torch_by_the_compiler_of_direct3d(compared: Compared, tmp_path: Path) -> None:
    source = tmp_path / HLSL
    source.write_text((compared.folder / HLSL).read_text() + HLSL_MAIN)
    # Direct3D 12 reads DXIL, of which this checks that it is made without a warning; SPIR-V is what can run here.
    dxc("cs_6_0", "-WX", source, tmp_path / "dxil")
    binary = dxc("cs_6_2", "-spirv", source, tmp_path / "spirv")
    found = webgpu.run(tmp_path, {HLSL: webgpu.Shader(binary, OUTPUTS)}, compared.inputs)[HLSL]
    assert 0.0 < (np.abs(found - compared.truth) / np.maximum(1.0, np.abs(compared.truth))).max() <= 1e-5


def dxc(profile: str, option: str, source: Path, target: Path) -> bytes:
    """A compute shader in HLSL, compiled by DXC."""
    command = ["dxc", "-T", profile, "-E", "main", option, str(source), "-Fo", str(target)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[-3000:]
    return target.read_bytes()


def test_wgsl_makes_the_features_of_the_self_test(compared: Compared, tmp_path: Path) -> None:
    test = load_manifest(compared.folder).self_test
    assert test is not None
    start = webgpu.BINDINGS.replace("DIAPHANE_OUTPUTS", "DIAPHANE_FEATURES")
    shader = webgpu.Shader((compared.folder / WGSL).read_text() + start + SUMS_MAIN, len(test.derived[0]))
    found = webgpu.run(tmp_path, {"features": shader}, np.array(test.sums, np.float32))["features"]
    expected = np.array(test.derived)
    assert (np.abs(found - expected) / np.maximum(1.0, np.abs(expected))).max() <= 0.1 * test.feature_tolerance


def test_every_form_passes_its_self_test(compared: Compared, tmp_path: Path) -> None:
    test = load_manifest(compared.folder).self_test
    assert test is not None
    rows = [int(np.flatnonzero((compared.inputs == np.float32(row)).all(axis=1))[0]) for row in test.features]
    for name, outputs in compared.found.items():
        difference = np.abs(outputs[rows] - np.array(test.outputs)) / np.array(test.output_scale)
        assert difference.max() <= test.tolerance[name], name


def test_forms_agree_on_zink(compared: Compared, tmp_path: Path) -> None:
    np.save(tmp_path / "rows.npy", compared.features)
    (tmp_path / "runtime").mkdir(mode=0o700)
    command = [sys.executable, "-m", "support.forms", str(compared.folder), str(tmp_path / "rows.npy")]
    variables = environment(ZINK, tmp_path / "runtime")
    done = subprocess.run(command, env=variables, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[-3000:]
    report = ParityReport.model_validate_json(done.stdout.splitlines()[-1])
    assert report.driver.startswith("zink")
    assert report.count == len(compared.inputs)
    assert report.worst <= 1e-5
    assert set(report.half) == {GLSL_HALF, UBO_HALF}
    assert max(report.half.values()) <= report.half_tolerance
