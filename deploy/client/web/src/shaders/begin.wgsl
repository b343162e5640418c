// From the blocks' totals to what the frame has to solve, and where the first round counts. One work group.
@group(0) @binding(0) var<storage, read> blocks: array<vec3u>;  // fragments, occupied, deepest
@group(0) @binding(1) var<storage, read_write> state: State;
@group(0) @binding(2) var<uniform> budget: u32;
var<workgroup> part: array<vec3u, 256>;

fn joined(one: vec3u, two: vec3u) -> vec3u {
    return vec3u(add(one.x, two.x), one.y + two.y, max(one.z, two.z));
}

@compute @workgroup_size(256)
fn begin(@builtin(local_invocation_index) lane: u32) {
    var own = vec3u(0u);
    for (var block = lane; block < arrayLength(&blocks); block += 256u) {
        own = joined(own, blocks[block]);
    }
    part[lane] = own;
    workgroupBarrier();
    if (lane > 0u) {
        return;
    }
    for (var i = 1u; i < 256u; i++) {
        own = joined(own, part[i]);
    }
    state.fragments = own.x;
    state.occupied = own.y;
    state.deepest = own.z;
    state.complete = select(0u, 1u, budget >= own.x);
    state.budget = budget;
    state.low = -LAST;
    state.high = LAST;
    // A warm start counts closely around the last answer: if this frame's is there, the next round finds it.
    let first = state.answer / EDGES * EDGES - EDGES * EDGES / 2;
    for (var j = 0; j < EDGES; j++) {
        if (state.warm == 1u) {
            state.edge[j] = clamp(first + EDGES * j, -LAST, LAST);
        } else {
            state.edge[j] = edge_between(-LAST, LAST, j);
        }
    }
}
