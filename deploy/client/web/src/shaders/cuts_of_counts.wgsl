// A pixel's bins as a selection of cuts sees them (renderer/shaders/allocation/{bins,rank}.glsl). `counts`, [P][FOURS], is
// declared before.
fn count_of(p: u32, bin: u32) -> u32 {
    return (counts[FOURS * p + bin / 4u] >> (8u * (bin & 3u))) & FULL;
}

// Fragments of all bins, as far as they are known.
fn known_fragments(p: u32) -> u32 {
    var sum = 0u;
    for (var bin = 0u; bin < BINS; bin++) {
        sum += count_of(p, bin);
    }
    return sum;
}

// Fragments of a bin that can be in a core behind `before` others; FULL where it cannot, nor can those behind it.
fn usable_in(p: u32, bin: u32, before: u32) -> u32 {
    let own = count_of(p, bin);
    return select(own, FULL, before + own > MOST_CORE);
}

// Rank of the price from which a cut of `after` fragments is nearer to what a gain curve asks for than one of `before`.
fn rank_of(curve: vec2f, before: u32, after: u32) -> u32 {
    let price = curve.y * (0.5 * f32(before + after) - 1.0) - curve.x;
    let bits = bitcast<u32>(price);
    return select(bits + 0x80000000u, 0xffffffffu - bits, bits >> 31u == 1u) >> DROPPED_BITS;
}
