// Which edges hold the budget between them; where the next round counts. One work group.
@group(0) @binding(0) var<storage, read_write> state: State;
@group(0) @binding(1) var<storage, read> counts: array<u32>;  // [blocks][EDGES]
const SLICES = 256u / u32(EDGES);
var<workgroup> part: array<u32, 256>;

@compute @workgroup_size(256)
fn choose(@builtin(local_invocation_index) lane: u32) {
    var own = 0u;
    for (var row = lane / u32(EDGES); row < arrayLength(&counts) / u32(EDGES); row += SLICES) {
        own = add(own, counts[row * u32(EDGES) + lane % u32(EDGES)]);
    }
    part[lane] = own;
    workgroupBarrier();
    if (lane > 0u || state.complete == 1u || is_found(state.low, state.high)) {
        return;
    }
    for (var j = 0u; j < u32(EDGES); j++) {
        var sum = 0u;
        for (var slice = 0u; slice < SLICES; slice++) {
            sum = add(sum, part[slice * u32(EDGES) + j]);
        }
        if (sum > state.budget) {
            state.high = state.edge[j];
            break;
        }
        state.low = state.edge[j];
    }
    let low = state.low;
    let high = state.high;
    state.answer = low;
    state.warm = 1u;
    for (var j = 0; j < EDGES; j++) {
        state.edge[j] = edge_between(low, high, j);
    }
}
