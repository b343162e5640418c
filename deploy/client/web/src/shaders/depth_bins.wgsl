// Depth bins of the binned density tails (METHOD.md section 2): renderer/shaders/common/depth_bins.glsl in WGSL.
// A pixel's words: D, float bits; then the shares of D in front of bins 1 to BINS - 1, 4 bits each, the nearest lowest.
const WORDS = 1u + BINS / 8u;

// Bin and position in it, in [0, BINS].
fn bin_place(z: f32, nearest: f32, extent: f32) -> f32 {
    let x = select(0.0, (z - nearest) / extent, extent > 0.0);
    return (PLAIN_SHARE * x + ROOT_SHARE * sqrt(x)) * f32(BINS);
}
