// A pixel's packed bins as a selection of cuts sees them (renderer/shaders/allocation/{bins,rank}.glsl). `words`, [P][BINS],
// is declared before.
fn count_of(p: u32, bin: u32) -> u32 {
    return (words[counts_at(p, bin / 4u)] >> (8u * (bin & 3u))) & FULL;
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
    let above = max(price - LEAST_PRICE, 1.0);
    return min((bitcast<u32>(above) - bitcast<u32>(1.0f)) >> DROPPED_BITS, RANKS - 1u);
}

// A predicted curve, log gain(k) = a - b (k - 1).
fn curve_of(p: u32) -> vec2f {
    return bitcast<vec2f>(vec2u(words[curve_at(p)], words[curve_at(p) + 1u]));
}
