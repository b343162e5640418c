// One additive pass for a binned tail, and what a network reads beside it (renderer/shaders/gather/bins.frag). WebGPU
// does not blend rgba16unorm everywhere: a word of storage has a bin's optical depth in its higher half, in whole units,
// and the same times the position in the bin in its lower one.
@group(2) @binding(0) var<storage, read> ranges: array<vec2f>;                // [T]
@group(2) @binding(1) var<storage, read_write> bins: array<atomic<u32>>;      // [P][BINS]
@group(2) @binding(2) var<storage, read_write> counts: array<atomic<u32>>;    // [P][FOURS], 8 bits a bin

struct Sums {
    @location(0) colours: vec4f,  // sum l rgb, sum l y luma: l optical depth, y place from 0 to 1
    @location(1) squares: vec4f,  // sum l rgb^2, sum l y
}

// Both halves stop where they are full.
fn add_to_bin(at: u32, units: u32, moved: u32) {
    var before = atomicLoad(&bins[at]);
    loop {
        let sum = min(vec2u(before >> 16u, before & BIN_LIMIT) + vec2u(units, moved), vec2u(BIN_LIMIT));
        let tried = atomicCompareExchangeWeak(&bins[at], before, (sum.x << 16u) | sum.y);
        if (tried.exchanged) {
            return;
        }
        before = tried.old_value;
    }
}

// A full count stays full.
fn count_in(p: u32, bin: u32) {
    let at = FOURS * p + bin / 4u;
    let shift = 8u * (bin & 3u);
    var before = atomicLoad(&counts[at]);
    while (((before >> shift) & FULL) < FULL) {
        let tried = atomicCompareExchangeWeak(&counts[at], before, before + (1u << shift));
        if (tried.exchanged) {
            return;
        }
        before = tried.old_value;
    }
}

// The fragment's place among its pixel's bins, where it was added.
fn gather(in: Surface, optical_depth: f32) -> f32 {
    let p = pixel_of(in);
    let place = bin_place(bitcast<f32>(depth_bits(in)), ranges[tile_of(p, camera.size.x)]);
    let bin = bin_of(place);
    let units = max(1.0, floor(optical_depth * OPTICAL_UNIT + 0.5));
    add_to_bin(BINS * p + bin, u32(units), u32(units * (place - f32(bin)) + 0.5));
    return place;
}

fn optical_depth_of(stored: vec4u) -> f32 {
    return -log(1.0 - f32(stored.a) / 255.0);
}

// For the tail alone.
@fragment
fn gather_tail(in: Surface) {
    let stored = stored_surface(in);
    if (is_hidden(in) || !is_transparent(stored)) {
        return;
    }
    _ = gather(in, optical_depth_of(stored));
}

// For a network as well.
@fragment
fn gather_all(in: Surface) -> Sums {
    let stored = stored_surface(in);
    if (is_hidden(in) || !is_transparent(stored)) {
        discard;
        return Sums();
    }
    let optical_depth = optical_depth_of(stored);
    let place = gather(in, optical_depth);
    count_in(pixel_of(in), bin_of(place));
    let rgb = vec3f(stored.rgb) / 255.0;
    let y = place / f32(BINS);
    let luma = dot(rgb, vec3f(LUMA_R, LUMA_G, LUMA_B));
    return Sums(optical_depth * vec4f(rgb, y * luma), optical_depth * vec4f(rgb * rgb, y));
}
