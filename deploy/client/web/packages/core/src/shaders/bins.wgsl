// Depth bins of the binned tails (METHOD.md section 2): renderer/shaders/common/depth_bins.glsl and tile_range.glsl.
fn tile_of(p: u32, width: u32) -> u32 {
    return p / width / RANGE_TILE * ((width + RANGE_TILE - 1) / RANGE_TILE) + p % width / RANGE_TILE;
}

// Bin and position in it, in [0, BINS]; range is nearest depth and extent.
fn bin_place(z: f32, range: vec2f) -> f32 {
    let x = select(0.0, clamp((z - range.x) / range.y, 0.0, 1.0), range.y > 0.0);
    return (PLAIN_SHARE * x + ROOT_SHARE * sqrt(x)) * f32(BINS);
}

fn bin_of(place: f32) -> u32 {
    return min(u32(place), BINS - 1u);
}
