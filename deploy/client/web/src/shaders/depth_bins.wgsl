// Depth bins of the binned density tails (METHOD.md section 2): renderer/shaders/common/depth_bins.glsl in WGSL.
// GATHERED words a pixel: D; ~ of the nearest packed colour; then, while fragments are gathered, units of the bins, 16
// bits each, and after it the shares of D in front of bins 1 to BINS - 1, 4 bits each; the nearest lowest.

// Bin and position in it, in [0, BINS]; x is the relative depth.
fn bin_place(x: f32) -> f32 {
    return (PLAIN_SHARE * x + ROOT_SHARE * sqrt(x)) * f32(BINS);
}

// Word and bit of the share in front of a bin, from 1 on.
fn share_word(p: u32, bin: u32) -> u32 {
    return GATHERED * p + 2u + (bin - 1u) / 8u;
}

fn share_shift(bin: u32) -> u32 {
    return 4u * ((bin - 1u) & 7u);
}
