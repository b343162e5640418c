// What every pixel gets at the found price, and by how much it grows at the next one; both fit 16 bits. Kept as
// integers: later passes need not round as this one does for the budget to be met.
@group(0) @binding(0) var<storage, read> state: State;
@group(0) @binding(1) var<storage, read> statistics: array<Statistics>;
@group(0) @binding(2) var<storage, read> curves: array<vec2f>;
@group(0) @binding(3) var<storage, read_write> slots: array<u32>;       // [P], low half: slots, high half: growth
@group(0) @binding(4) var<storage, read_write> sums: array<vec2u>;      // [blocks]
var<workgroup> sure: atomic<u32>;
var<workgroup> growth: atomic<u32>;

fn slots_of(p: u32) -> vec2u {
    let most = usable(statistics[p].n);
    if (state.complete == 1u || most == 0u) {
        return vec2u(most, 0u);
    }
    let low = fragments_at(price(state.low), curves[p], most);
    return vec2u(low, max(fragments_at(price(state.high), curves[p], most), low) - low);
}

@compute @workgroup_size(256)
fn find_slots(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    var own = vec2u(0u);
    for (var i = 0u; i < BLOCK / 256u; i++) {
        let p = group.x * BLOCK + i * 256u + lane;
        if (p < arrayLength(&slots)) {
            let here = slots_of(p);
            slots[p] = here.x | (here.y << 16u);
            own += here;
        }
    }
    atomicAdd(&sure, own.x);
    atomicAdd(&growth, own.y);
    workgroupBarrier();
    if (lane == 0u) {
        sums[group.x] = vec2u(atomicLoad(&sure), atomicLoad(&growth));
    }
}
