// Order-independent sums over all fragments of a pixel (renderer/shaders/gather/gather.frag).
// Integers by atomics: the optical depth and the units of its depth bins, the nearest colour. WebGPU blends neither
// r32float nor rgba16unorm everywhere. Half floats by blending: what else a network reads, packed into four targets, as
// many as every device has room for.
struct Sums {
    @location(0) rgb_x: vec4f,          // sum rgb, sum x
    @location(1) alpha_rgb_x2: vec4f,   // sum a rgb, sum x^2
    @location(2) rgb2_alpha: vec4f,     // sum rgb^2, sum a
    @location(3) rgb_x_alpha2: vec4f,   // sum rgb x, sum a^2
}

@group(2) @binding(0) var<storage, read> statistics: array<Statistics>;
@group(2) @binding(1) var<storage, read_write> gathered: array<atomic<u32>>;  // [P][GATHERED]; D in OPTICAL_ONE-ths

// Adds to one of a word's halves, up to BIN_LIMIT: a sum beyond it would go on in the other half.
fn add_to_half(at: u32, shift: u32, units: u32) {
    var before = atomicLoad(&gathered[at]);
    loop {
        let room = BIN_LIMIT - ((before >> shift) & BIN_LIMIT);
        if (room == 0u) {
            return;
        }
        let tried = atomicCompareExchangeWeak(&gathered[at], before, before + (min(units, room) << shift));
        if (tried.exchanged) {
            return;
        }
        before = tried.old_value;
    }
}

fn gather(in: Surface, stored: vec4u) -> f32 {
    let p = pixel_of(in);
    let z = depth_bits(in);
    let here = statistics[p];
    let x = relative_depth(bitcast<f32>(z), here);
    let optical_depth = -log(1.0 - f32(stored.a) / 255.0);
    let at = GATHERED * p;
    // Beyond OPTICAL_CEILING nothing is visible, and the sum must not wrap round.
    if (atomicLoad(&gathered[at]) < OPTICAL_CEILING) {
        atomicAdd(&gathered[at], u32(optical_depth * OPTICAL_ONE + 0.5));
    }
    if (~z == here.near) {  // ties: the smaller packed colour
        atomicMax(&gathered[at + 1u], ~pack(stored));
    }
    if (BINS > 0u) {
        let bin = min(u32(bin_place(x)), LAST_BIN);
        let units = u32(max(1.0, floor(optical_depth * OPTICAL_UNIT + 0.5)));
        add_to_half(at + 2u + bin / 2u, 16u * (bin & 1u), units);
    }
    return x;
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
fn gather_all(in: Surface) -> Sums {
    let stored = stored_surface(in);
    if (is_hidden(in) || !is_transparent(stored)) {
        discard;
        return Sums();
    }
    let x = gather(in, stored);
    let rgb = vec3f(stored.rgb) / 255.0;
    let a = f32(stored.a) / 255.0;
    return Sums(vec4f(rgb, x), vec4f(a * rgb, x * x), vec4f(rgb * rgb, a), vec4f(rgb * x, a * a));
}
