// The bundle's network on every occupied pixel: a and b of log gain(k) = a - b (k - 1), within the limits that ranks need
// (renderer/shaders/kbuffer-deep/curves.comp and inputs.glsl).
@group(0) @binding(0) var<storage, read_write> words: array<u32>;  // [P][BINS], packed
@group(0) @binding(1) var<storage, read> state: Cuts;
@group(0) @binding(2) var<storage, read> ranges: array<vec2f>;     // [T]
@group(0) @binding(3) var<storage, read> luma: array<u32>;         // [P], sums of luma and of its square
@group(0) @binding(4) var background: texture_2d<f32>;

// `clamp`, and the given number for NaN, which a network that overflows can answer.
fn within(x: f32, least: f32, most: f32, for_nan: f32) -> f32 {
    let is_nan = (bitcast<u32>(x) & 0x7fffffffu) > 0x7f800000u;
    return select(clamp(x, least, most), for_nan, is_nan);
}

fn sums_of(p: u32, fragments: u32) -> array<vec4f, TEXELS> {
    let range = ranges[tile_of(p, textureDimensions(background).x)];
    var s: array<vec4f, TEXELS>;
    s[0] = vec4f(f32(fragments), optical_depth_at(p), range.x, range.x + range.y);
    s[1] = vec4f(texel_of(background, p).rgb, 0.0);
    let unit = vec2f(f32(1u << LUMA_SHIFT) / 255.0, f32(1u << LUMA_SQUARE_SHIFT) / (255.0 * 255.0)) / OPTICAL_UNIT;
    s[2] = vec4f(vec2f(vec2u(luma[p] >> 16u, luma[p] & 0xffffu)) * unit, 0.0, 0.0);
    for (var b = 0u; b < BINS - 1u; b++) {
        let word = kept_word(p, b);
        s[3u + b / 4u][b % 4u] = share_behind(word);
        if (MEAN_LEVELS > 0) {
            s[7u + b / 4u][b % 4u] = mean_in(word);
        }
    }
    return s;
}

fn put_curve(p: u32, curve: vec2f) {
    words[curve_at(p)] = bitcast<u32>(curve.x);
    words[curve_at(p) + 1u] = bitcast<u32>(curve.y);
}

@compute @workgroup_size(64)
fn predict_curves(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let p = thread_of(id, groups);
    if (BINS * p >= arrayLength(&words) || state.complete == 1u) {
        return;
    }
    let fragments = known_fragments(p);
    if (fragments == 0u) {
        return;
    }
    let y = Answer(diaphane_predict(diaphane_features(sums_of(p, fragments))));
    if (DIAPHANE_OUTPUTS == 1) {
        let fall = 1.0 / within(y.x, 1.0 / MOST_FALL, 1.0, 1.0 / MOST_FALL);
        put_curve(p, vec2f(max(-1.5 * fall, -MOST_GAIN), fall));
        return;
    }
    let gain = within(y.x, -MOST_GAIN, MOST_GAIN, -MOST_GAIN);
    put_curve(p, vec2f(gain, within(y.y, LEAST_FALL, MOST_FALL, MOST_FALL)));
}
