// Where each pixel's run of slots begins. What is left of the budget goes to the pixels that grow at the next price, in
// the order of their index (renderer/shaders/allocation/offsets.comp). No run reaches beyond the budget.
@group(0) @binding(0) var<storage, read> state: State;
@group(0) @binding(1) var<storage, read> slots: array<u32>;             // [P]
@group(0) @binding(2) var<storage, read> sums: array<vec2u>;            // [blocks], before each
@group(0) @binding(3) var<storage, read_write> offsets: array<u32>;     // [P + 1]
@group(0) @binding(4) var<uniform> budget: u32;
const OWN = BLOCK / 256u;
var<workgroup> part: array<vec2u, 256>;

@compute @workgroup_size(256)
fn place_slots(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    let first = group.x * BLOCK + lane * OWN;
    var here: array<vec2u, OWN>;
    var own = vec2u(0u);
    for (var i = 0u; i < OWN; i++) {
        if (first + i < arrayLength(&slots)) {
            here[i] = vec2u(slots[first + i] & 0xffffu, slots[first + i] >> 16u);
        }
        own += here[i];
    }
    part[lane] = own;
    for (var reach = 1u; reach < 256u; reach *= 2u) {
        workgroupBarrier();
        var other = vec2u(0u);
        if (lane >= reach) {
            other = part[lane - reach];
        }
        workgroupBarrier();
        part[lane] += other;
    }
    var before = add2(sums[group.x], part[lane] - own);
    let spare = budget - min(budget, state.sure);
    for (var i = 0u; i < OWN; i++) {
        if (first + i < arrayLength(&offsets)) {
            offsets[first + i] = min(before.x + min(before.y, spare), budget);
        }
        before = add2(before, here[i]);
    }
}
