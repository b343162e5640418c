// What is kept of a pixel's depth bins, 16 bits each, two a word, and what it says of a fragment
// (renderer/shaders/common/kept_bins.glsl). `words`, [P][BINS], is declared before.
fn kept_word(p: u32, bin: u32) -> u32 {
    return (words[BINS * p + bin / 2u] >> (16u * (bin & 1u))) & 0xffffu;
}

fn optical_depth_at(p: u32) -> f32 {
    return f32(kept_word(p, BINS - 1u)) / OPTICAL_UNIT;
}

// Of a bin's word: the share of D in front of the next bin.
fn share_behind(word: u32) -> f32 {
    return f32(word >> 8u) / f32(SHARE_LEVELS);
}

// Of a bin's word: the mean position of its optical depth in it.
fn mean_in(word: u32) -> f32 {
    return select(0.5, f32(word & 255u) / f32(max(MEAN_LEVELS, 1)), MEAN_LEVELS > 0);
}
