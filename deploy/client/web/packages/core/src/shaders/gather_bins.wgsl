// Every fragment into its depth bin: one word, one atomic exchange; for a network, one more for its colour
// (renderer/shaders/gather/bins.frag).
@group(2) @binding(0) var<storage, read> ranges: array<vec2f>;             // [T]
@group(2) @binding(1) var<storage, read_write> words: array<atomic<u32>>;  // [P][BINS]
@group(2) @binding(2) var<storage, read_write> luma: array<atomic<u32>>;   // [P], sums of luma and of its square

// What is full stays full. What others add meanwhile makes the exchange fail, and it is tried again.
fn add_to_bin(at: u32, units: u32, moment: u32) {
    var before = atomicLoad(&words[at]);
    loop {
        var sum = min(units_of(before) + units, BIN_LIMIT) << UNITS_SHIFT;
        sum |= min(moment_of(before) + moment, BIN_LIMIT) << MOMENT_SHIFT;
        sum |= min(fragments_of(before) + 1u, COUNT_LIMIT);
        if (sum == before) {
            return;
        }
        let tried = atomicCompareExchangeWeak(&words[at], before, sum);
        if (tried.exchanged) {
            return;
        }
        before = tried.old_value;
    }
}

// Whole numbers: what a network reads of colours is the same on every device, too.
fn add_luma(p: u32, units: u32, rgb: vec3u) {
    let own = (dot(rgb, vec3u(LUMA_R, LUMA_G, LUMA_B)) + 128u) >> 8u;
    let first = (units * own + (1u << (LUMA_SHIFT - 1))) >> LUMA_SHIFT;
    let second = (units * own * own + (1u << (LUMA_SQUARE_SHIFT - 1))) >> LUMA_SQUARE_SHIFT;
    var before = atomicLoad(&luma[p]);
    loop {
        let sum = (min((before >> 16u) + first, 0xffffu) << 16u) | min((before & 0xffffu) + second, 0xffffu);
        if (sum == before) {
            return;
        }
        let tried = atomicCompareExchangeWeak(&luma[p], before, sum);
        if (tried.exchanged) {
            return;
        }
        before = tried.old_value;
    }
}

// The fragment's units, where it was added.
fn gather(in: Surface, stored: vec4u) -> u32 {
    let p = pixel_of(in);
    let place = bin_place(bitcast<f32>(depth_bits(in)), ranges[tile_of(p, camera.size.x)]);
    let bin = bin_of(place);
    let units = max(1.0, floor(-log(1.0 - f32(stored.a) / 255.0) * OPTICAL_UNIT + 0.5));
    add_to_bin(BINS * p + bin, u32(units), u32(units * (place - f32(bin)) + 0.5));
    return u32(units);
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
