// Offsets of the fixed k-buffer: the same number of slots for every pixel of the window.
@group(0) @binding(0) var<storage, read_write> offsets: array<u32>;  // [P + 1]
@group(0) @binding(1) var<uniform> budget: u32;

@compute @workgroup_size(64)
fn place_fixed(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let p = thread_of(id, groups);
    if (p < arrayLength(&offsets)) {
        offsets[p] = p * (budget / (arrayLength(&offsets) - 1u));
    }
}
