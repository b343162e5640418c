// Which half of a rank the budget ends in. One work group.
@group(0) @binding(0) var<storage, read_write> state: Cuts;
@group(0) @binding(1) var<storage, read_write> counted: array<u32>;  // [HALVES]
@group(0) @binding(2) var<uniform> budget: u32;
const OWN = HALVES / 256u;
var<workgroup> part: array<u32, 256>;

fn choose(lane: u32, is_low: bool) {
    var own = 0u;
    for (var i = 0u; i < OWN; i++) {
        own += counted[lane * OWN + i];
    }
    part[lane] = own;
    var before = state.spent;
    workgroupBarrier();
    for (var i = 0u; i < lane; i++) {
        before += part[i];
    }
    storageBarrier();
    // Exactly one thread's run has the first number with which it is too much.
    if (state.complete == 0u && before <= budget && before + own > budget) {
        var i = lane * OWN;
        for (; before + counted[i] <= budget; i++) {
            before += counted[i];
        }
        state.spent = before;
        if (is_low) {
            state.rank = (state.high << HALF_BITS) | i;
        } else {
            state.high = i;
        }
    }
    for (var i = 0u; i < OWN; i++) {
        counted[lane * OWN + i] = 0u;
    }
}

@compute @workgroup_size(256)
fn choose_high(@builtin(local_invocation_index) lane: u32) {
    choose(lane, false);
}

@compute @workgroup_size(256)
fn choose_low(@builtin(local_invocation_index) lane: u32) {
    choose(lane, true);
}
