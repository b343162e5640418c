// The rank that the budget ends in. One work group.
@group(0) @binding(0) var<storage, read_write> state: Cuts;
@group(0) @binding(1) var<storage, read> counted: array<u32>;  // [RANKS]
@group(0) @binding(2) var<uniform> budget: u32;
const OWN = RANKS / 256u;
var<workgroup> part: array<u32, 256>;

@compute @workgroup_size(256)
fn choose(@builtin(local_invocation_index) lane: u32) {
    var own = 0u;
    for (var i = 0u; i < OWN; i++) {
        own += counted[lane * OWN + i];
    }
    part[lane] = own;
    workgroupBarrier();
    var before = 0u;
    for (var i = 0u; i < lane; i++) {
        before += part[i];
    }
    // Exactly one thread's run has the first number with which it is too much.
    if (state.complete == 0u && before <= budget && before + own > budget) {
        var i = lane * OWN;
        for (; before + counted[i] <= budget; i++) {
            before += counted[i];
        }
        state.rank = i;
    }
}
