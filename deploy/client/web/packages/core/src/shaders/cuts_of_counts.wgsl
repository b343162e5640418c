// A pixel's packed bins as a selection of cuts sees them (renderer/shaders/allocation/bins.glsl). `words`, [P][BINS], is
// declared before.
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

// Of the price that a bin comes at (prices.wgsl).
fn rank_in(p: u32, bin: u32) -> u32 {
    return (words[ranks_at(p, bin / 4u)] >> (8u * (bin & 3u))) & (RANKS - 1u);
}
