// Second pass of the chain: every fragment finds its slot by its depth, or goes to the tail
// (renderer/shaders/kbuffer/chain_colour.frag and tail.glsl). Depths and colours are kept inverted.
@group(2) @binding(0) var<storage, read> offsets: array<u32>;  // [P + 1]
@group(2) @binding(1) var<storage, read> depths: array<u32>;
@group(2) @binding(2) var<storage, read_write> colours: array<atomic<u32>>;
@group(2) @binding(3) var<storage, read> statistics: array<Statistics>;
@group(2) @binding(4) var<storage, read> gathered: array<u32>;  // [P][GATHERED]

// Share of D in front of a bin.
fn share_in_front(p: u32, bin: u32) -> f32 {
    if (bin == 0u) {
        return 0.0;
    }
    if (bin == BINS) {
        return 1.0;
    }
    return f32((gathered[share_word(p, bin)] >> share_shift(bin)) & SHARE_LEVELS) / f32(SHARE_LEVELS);
}

// Optical depth in front of a fragment, as far as the tail asks for it. With bins: those before its own, and of its
// bin's others, taken as evenly spread.
fn in_front(p: u32, z: f32, own: f32) -> f32 {
    let total = bitcast<f32>(gathered[GATHERED * p]);
    let x = relative_depth(z, statistics[p]);
    if (TAIL == BINNED) {
        let place = bin_place(x);
        let bin = min(u32(place), LAST_BIN);
        let before = total * share_in_front(p, bin);
        let others = total * share_in_front(p, bin + 1u) - before - own;
        return before + max(others, 0.0) * (place - f32(bin));
    }
    return select(0.0, DENSITY_G * total * x, TAIL == DENSITY);
}

fn first_slot_not_nearer(first: u32, last: u32, z: u32) -> u32 {
    var begin = first;
    var end = last;
    while (begin < end) {
        let middle = (begin + end) >> 1u;
        if (depths[middle] > z) {
            begin = middle + 1u;
        } else {
            end = middle;
        }
    }
    return begin;
}

@fragment
fn chain_colour(in: Surface) -> @location(0) vec4f {  // sum w C, sum w
    let stored = stored_surface(in);
    if (is_hidden(in) || !is_transparent(stored)) {
        discard;
        return vec4f(0.0);
    }
    let p = pixel_of(in);
    let end = offsets[p + 1u];
    let z = ~depth_bits(in);
    var word = ~pack(stored);
    for (var i = first_slot_not_nearer(offsets[p], end, z); i < end && depths[i] == z; i++) {
        let before = atomicMax(&colours[i], word);
        if (before == 0u) {  // it found a free slot: nothing is left for the tail
            discard;
            return vec4f(0.0);
        }
        word = min(word, before);
    }
    let fallen = vec4f(unpack(~word)) / 255.0;
    let exponent = in_front(p, bitcast<f32>(~z), -log(1.0 - fallen.a));
    let weight = fallen.a * exp(-min(exponent, MAX_EXPONENT));
    return vec4f(weight * fallen.rgb * fallen.rgb, weight);
}
