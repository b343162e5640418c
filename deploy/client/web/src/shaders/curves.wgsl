// The bundle's network on the gathered sums of every pixel with a choice: a and 1 / b of log gain(k) = a - b (k - 1)
// (renderer/shaders/kbuffer-deep/curves.comp). An importance w is a curve, too: k = floor(t w) at the price t.
@group(0) @binding(0) var<storage, read> state: State;
@group(0) @binding(1) var<storage, read> statistics: array<Statistics>;
@group(0) @binding(2) var<storage, read> gathered: array<u32>;
@group(0) @binding(3) var<storage, read_write> curves: array<vec2f>;
@group(0) @binding(4) var background: texture_2d<f32>;
@group(0) @binding(5) var sums0: texture_2d<f32>;
@group(0) @binding(6) var sums1: texture_2d<f32>;
@group(0) @binding(7) var sums2: texture_2d<f32>;
@group(0) @binding(8) var sums3: texture_2d<f32>;

// `clamp`, and the least for NaN, which a network that overflows can answer.
fn within(x: f32, least: f32, most: f32) -> f32 {
    let is_nan = (bitcast<u32>(x) & 0x7fffffffu) > 0x7f800000u;
    return select(clamp(x, least, most), least, is_nan);
}

fn sums_of(p: u32) -> array<vec4f, 11> {
    let here = statistics[p];
    let second = texel_of(sums2, p);
    let third = texel_of(sums3, p);
    let word = ~gathered[GATHERED * p + 1u];
    var s: array<vec4f, 11>;
    s[0] = vec4f(f32(here.n), second.w, third.w, bitcast<f32>(gathered[GATHERED * p]));
    s[1] = texel_of(sums0, p);
    s[2] = texel_of(sums1, p);
    s[3] = vec4f(second.rgb, nearest(here));
    s[4] = vec4f(third.rgb, bitcast<f32>(here.far));
    s[5] = vec4f(vec4u(word, word >> 8u, word >> 16u, word >> 24u) & vec4u(255u)) / 255.0;
    s[6] = vec4f(texel_of(background, p).rgb, 0.0);
    for (var b = 1u; b < BINS; b++) {  // bin b here is bin EVERY b of 16
        let share = (gathered[share_word(p, b)] >> share_shift(b)) & SHARE_LEVELS;
        let j = EVERY * b - 1u;
        s[7u + j / 4u][j % 4u] = f32(share) / f32(SHARE_LEVELS);
    }
    return s;
}

@compute @workgroup_size(64)
fn predict_curves(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let p = thread_of(id, groups);
    if (p >= arrayLength(&curves) || state.complete == 1u || statistics[p].n == 0u) {
        return;
    }
    let y = Answer(diaphane_predict(diaphane_features(sums_of(p))));
    var curve = vec2f(y.x, 1.0 / y.y);
    if (DIAPHANE_OUTPUTS == 1) {
        curve = vec2f(-1.5 / y.x, y.x);
    }
    curves[p] = vec2f(within(curve.x, -MOST_GAIN, MOST_GAIN), within(curve.y, LEAST_RATE, MOST_RATE));
}
