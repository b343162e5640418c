"""A compute shader in WGSL or SPIR-V on rows of numbers, through wgpu on Mesa's software Vulkan driver.

It runs in a process of its own (`python -m support.webgpu JOBS`), where there is no OpenGL context beside it.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

ROOT = Path(__file__).parents[2]
GROUP = 64

BINDINGS = f"""
@group(0) @binding(0) var<storage, read> inputs: array<f32>;
@group(0) @binding(1) var<storage, read_write> outputs: array<f32>;

@compute @workgroup_size({GROUP})
fn main(@builtin(global_invocation_id) id: vec3u) {{
    let row = id.x;
    if (row * DIAPHANE_OUTPUTS >= arrayLength(&outputs)) {{
        return;
    }}
"""

PREDICT = (
    BINDINGS
    + """    var x: array<f32, DIAPHANE_FEATURES>;
    for (var i = 0u; i < DIAPHANE_FEATURES; i++) {
        x[i] = inputs[row * DIAPHANE_FEATURES + i];
    }
    var answer = diaphane_predict(x);
    for (var i = 0u; i < DIAPHANE_OUTPUTS; i++) {
        outputs[row * DIAPHANE_OUTPUTS + i] = answer.y[i];
    }
}
"""
)
"""What calls a bundle's WGSL."""


@dataclass(frozen=True)
class Shader:
    """A compute shader with the entry point `main` that turns rows into rows.

    Attributes:
        code: WGSL, or SPIR-V.
        columns: Numbers in a row of the output; the storage buffer of binding 1. The input is that of binding 0.
        data: The uniform buffer of binding 2, or None.
    """

    code: str | bytes
    columns: int
    data: bytes | None = None


def run(folder: Path, shaders: Mapping[str, Shader], inputs: NDArray[np.float32]) -> dict[str, NDArray[np.float32]]:
    """Run shaders in another process.

    Args:
        folder: For the files that go to and fro.
        shaders: By name.
        inputs: float32 [R, F], for all of them.

    Returns:
        Name -> float32 [R, columns].
    """
    jobs = []
    np.save(folder / "inputs.npy", inputs)
    for name, shader in shaders.items():
        source = folder / f"{name}{'.spv' if isinstance(shader.code, bytes) else '.wgsl'}"
        source.write_bytes(shader.code if isinstance(shader.code, bytes) else shader.code.encode())
        data = folder / f"{name}.bin"
        if shader.data is not None:
            data.write_bytes(shader.data)
        jobs.append([str(source), str(folder / f"{name}.npy"), shader.columns, str(data) if shader.data else None])
    (folder / "jobs.json").write_text(json.dumps({"inputs": str(folder / "inputs.npy"), "jobs": jobs}))
    command = [sys.executable, "-m", "support.webgpu", str(folder / "jobs.json")]
    done = subprocess.run(command, cwd=ROOT / "tests", capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[-4000:]
    return {name: np.load(folder / f"{name}.npy") for name in shaders}


def _device() -> Any:
    import wgpu
    from wgpu.backends.wgpu_native import extras

    extras.set_instance_extras(backends=["Vulkan"])
    adapters = [found for found in wgpu.gpu.enumerate_adapters_sync() if found.info["backend_type"] == "Vulkan"]
    adapter = next(found for found in adapters if "llvmpipe" in found.info["device"])
    return adapter.request_device_sync(required_features=["shader-f16"])


def _outputs(
    device: Any, source: Path, inputs: NDArray[np.float32], columns: int, data: bytes | None
) -> NDArray[np.float32]:
    import wgpu

    code = source.read_bytes() if source.suffix == ".spv" else source.read_text()
    pipeline = device.create_compute_pipeline(
        layout="auto", compute={"module": device.create_shader_module(code=code), "entry_point": "main"}
    )
    size = 4 * columns * len(inputs)
    buffers = [
        device.create_buffer_with_data(data=inputs, usage=wgpu.BufferUsage.STORAGE),
        device.create_buffer(size=size, usage=wgpu.BufferUsage.STORAGE | wgpu.BufferUsage.COPY_SRC),
    ]
    if data is not None:
        buffers.append(device.create_buffer_with_data(data=data, usage=wgpu.BufferUsage.UNIFORM))
    entries = [{"binding": i, "resource": {"buffer": buffer}} for i, buffer in enumerate(buffers)]
    group = device.create_bind_group(layout=pipeline.get_bind_group_layout(0), entries=entries)
    encoder = device.create_command_encoder()
    compute = encoder.begin_compute_pass()
    compute.set_pipeline(pipeline)
    compute.set_bind_group(0, group)
    compute.dispatch_workgroups(-(-len(inputs) // GROUP))
    compute.end()
    device.queue.submit([encoder.finish()])
    return np.frombuffer(device.queue.read_buffer(buffers[1]), dtype=np.float32).reshape(len(inputs), columns)


def _main(path: Path) -> None:
    device, described = _device(), json.loads(path.read_text())
    inputs = np.ascontiguousarray(np.load(described["inputs"]))
    for source, target, columns, data in described["jobs"]:
        block = Path(data).read_bytes() if data else None
        np.save(target, _outputs(device, Path(source), inputs, columns, block))


if __name__ == "__main__":
    _main(Path(sys.argv[1]))
