// From the blocks' totals to what the frame has to solve, and where the first round counts. One work group.
@group(0) @binding(0) var<storage, read> blocks: array<vec3u>;
@group(0) @binding(1) var<storage, read_write> state: State;
@group(0) @binding(2) var<uniform> budget: u32;
var<workgroup> part: array<vec3u, 256>;

@compute @workgroup_size(256)
fn begin(@builtin(local_invocation_index) lane: u32) {
    var own = vec3u(0u);
    for (var block = lane; block < arrayLength(&blocks); block += 256u) {
        own = vec3u(add(own.x, blocks[block].x), own.yz + blocks[block].yz);
    }
    part[lane] = own;
    workgroupBarrier();
    if (lane > 0u) {
        return;
    }
    for (var i = 1u; i < 256u; i++) {
        own = vec3u(add(own.x, part[i].x), own.yz + part[i].yz);
    }
    state.fragments = own.x;
    state.occupied = own.y;
    state.k_min = select(0u, 1u, budget >= own.y);
    state.complete = select(0u, 1u, budget >= own.x);
    state.left = budget - min(budget, state.k_min * own.z);
    state.low = -LAST;
    state.high = LAST;
    for (var j = 0; j < EDGES; j++) {
        state.edge[j] = edge_between(-LAST, LAST, j);
    }
}
