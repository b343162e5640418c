// From the blocks' totals to what the frame has to solve, and where the first round counts. One work group.
@group(0) @binding(0) var<storage, read> blocks: array<vec4u>;  // fragments, occupied, singles, deepest
@group(0) @binding(1) var<storage, read_write> state: State;
@group(0) @binding(2) var<uniform> budget: u32;
var<workgroup> part: array<vec4u, 256>;

fn joined(one: vec4u, two: vec4u) -> vec4u {
    return vec4u(add(one.x, two.x), one.yz + two.yz, max(one.w, two.w));
}

@compute @workgroup_size(256)
fn begin(@builtin(local_invocation_index) lane: u32) {
    var own = vec4u(0u);
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
    state.deepest = own.w;
    state.k_min = select(0u, 1u, budget >= own.y);
    state.complete = select(0u, 1u, budget >= own.x);
    state.left = budget - min(budget, state.k_min * own.z);
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
