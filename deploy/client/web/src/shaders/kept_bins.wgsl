// What the kept bins say of a fragment (renderer/shaders/common/kept_bins.glsl). `bins`, [P][BINS], is declared before.
fn optical_depth_at(p: u32) -> f32 {
    return f32(bins[BINS * p + BINS - 1u]) / OPTICAL_UNIT;
}

// Of a bin's word: the share of D in front of the next bin.
fn share_behind(word: u32) -> f32 {
    return f32(word >> 8u) / f32(SHARE_LEVELS);
}

// Of a bin's word: the mean position of its optical depth in it.
fn mean_in(word: u32) -> f32 {
    return select(0.5, f32(word & 255u) / f32(max(MEAN_LEVELS, 1)), MEAN_LEVELS > 0);
}
