// Whether there is anything to choose.
@group(0) @binding(0) var<storage, read_write> state: Cuts;
@group(0) @binding(1) var<uniform> budget: u32;

@compute @workgroup_size(1)
fn begin_cuts() {
    state.complete = select(0u, 1u, state.fragments <= budget);
}
