// Where each pixel's core begins in the pool. What is left of the budget goes to the pixels that grow at the chosen rank,
// by index; the first that does not fit takes what does (renderer/shaders/allocation/place.comp). No run reaches beyond the
// budget.
@group(0) @binding(0) var<storage, read> total: array<u32>;            // the last one: fragments granted
@group(0) @binding(1) var<storage, read_write> cuts: array<u32>;       // [P], as they were found; then bins of the core
@group(0) @binding(2) var<storage, read> sums: array<vec2u>;           // [blocks], before each
@group(0) @binding(3) var<storage, read_write> offsets: array<u32>;    // [P + 1]
@group(0) @binding(4) var<uniform> budget: u32;
@group(0) @binding(5) var<storage, read> words: array<u32>;            // [P][BINS]
const OWN = BLOCK / 256u;
var<workgroup> part: array<vec2u, 256>;

// Bins of a pixel that may grow by so many fragments and no more.
fn bins_within(p: u32, cut: u32, room: u32) -> u32 {
    var bins = cut & 31u;
    var taken = 0u;
    let end = (cut >> 15u) & 31u;
    for (var bin = bins; bin < end; bin++) {
        let own = count_of(p, bin);
        taken += own;
        if (taken > room) {
            break;
        }
        if (own > 0u) {
            bins = bin + 1u;
        }
    }
    return bins;
}

@compute @workgroup_size(256)
fn place_cuts(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    let first = group.x * BLOCK + lane * OWN;
    var here: array<u32, OWN>;
    var own = vec2u(0u);
    for (var i = 0u; i < OWN; i++) {
        if (first + i < arrayLength(&cuts)) {
            here[i] = cuts[first + i];
        }
        let granted = (here[i] >> 5u) & 0x3ffu;
        own += vec2u(granted, (here[i] >> 20u) - granted);
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
    var before = sums[group.x] + part[lane] - own;
    let spare = budget - min(budget, total[arrayLength(&total) - 1u]);
    for (var i = 0u; i < OWN; i++) {
        if (first + i < arrayLength(&offsets)) {
            offsets[first + i] = min(before.x + min(before.y, spare), budget);
        }
        let granted = (here[i] >> 5u) & 0x3ffu;
        let growth = (here[i] >> 20u) - granted;
        if (first + i < arrayLength(&cuts)) {
            var bins = here[i] & 31u;
            if (before.y + growth <= spare) {
                bins = (here[i] >> 15u) & 31u;
            } else if (before.y < spare) {
                bins = bins_within(first + i, here[i], spare - before.y);
            }
            cuts[first + i] = bins;
        }
        before += vec2u(granted, growth);
    }
}
