// Every fragment into its depth bin; for a network, its colour as well (renderer/shaders/gather/bins.frag).
@group(2) @binding(0) var<storage, read> ranges: array<vec2f>;             // [T]
@group(2) @binding(1) var<storage, read_write> words: array<atomic<u32>>;  // [P][BINS]
@group(2) @binding(2) var<storage, read_write> luma: array<atomic<u32>>;   // [P], sums of luma and of its square

// The fragment's units, where it was added.
fn gather(in: Surface, stored: vec4u) -> u32 {
    let p = pixel_of(in);
    let place = bin_place(bitcast<f32>(depth_bits(in)), ranges[tile_of(p, camera.size.x)]);
    let bin = bin_of(place);
    let units = units_in(-log(1.0 - f32(stored.a) / 255.0));
    add_to_bin(BINS * p + bin, units, u32(f32(units) * (place - f32(bin)) + 0.5));
    return units;
}

// For the tail alone.
@fragment
fn gather_tail(in: Surface) {
    let stored = stored_surface(in);
    if (is_hidden(in) || !is_transparent(stored)) {
        return;
    }
    _ = gather(in, stored);
}

// For a network as well.
@fragment
fn gather_all(in: Surface) {
    let stored = stored_surface(in);
    if (is_hidden(in) || !is_transparent(stored)) {
        return;
    }
    add_luma(pixel_of(in), gather(in, stored), stored.rgb);
}
