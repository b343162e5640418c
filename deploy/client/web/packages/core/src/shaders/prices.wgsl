// The bundle's network on every occupied pixel: what it answers of each bin becomes the rank of the bin's price
// (renderer/shaders/kbuffer-deep/prices.comp and inputs.glsl, allocation/prices.glsl).
@group(0) @binding(0) var<storage, read_write> words: array<u32>;  // [P][BINS], packed
@group(0) @binding(1) var<storage, read> state: Cuts;
@group(0) @binding(2) var<storage, read> ranges: array<vec2f>;     // [T]
@group(0) @binding(3) var<storage, read> luma: array<u32>;         // [P], sums of luma and of its square
@group(0) @binding(4) var background: texture_2d<f32>;

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

// What the tail tells of the log gain of one bin: n fragments, an optical depth `own` behind `before`; `whole` is the
// pixel's.
fn prior_gain(n: f32, own: f32, before: f32, whole: f32) -> f32 {
    let covered = max(1.0 - exp(-own), LEAST_COVERED);
    let wrong = clamp(whole * (0.5 / f32(SHARE_LEVELS)), LEAST_ALONE, MOST_ALONE);
    let alone = select(0.0, 2.0 * log(wrong), n == 1.0);
    return max(2.0 * (log(covered) - before) - log(n) + alone, LEAST_PRIOR);
}

// By its bits, because a compiler may take it that a comparison never meets NaN.
fn is_nan(x: f32) -> bool {
    return (bitcast<u32>(x) & 0x7fffffffu) > 0x7f800000u;
}

// NaN, of a network that overflows, comes last.
fn rank_of(price: f32) -> u32 {
    let steps = (price - LEAST_PRICE) * PRICE_STEPS;
    return select(u32(clamp(steps + 0.5, 0.0, f32(RANKS - 1))), RANKS - 1u, is_nan(price));
}

@compute @workgroup_size(64)
fn predict_ranks(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let p = thread_of(id, groups);
    if (BINS * p >= arrayLength(&words) || state.complete == 1u) {
        return;
    }
    let fragments = known_fragments(p);
    if (fragments == 0u) {
        return;
    }
    var answer = diaphane_predict(diaphane_features(sums_of(p, fragments)));
    let last = answer.y[DIAPHANE_OUTPUTS - 1];  // the weight of what the tail tells, or an importance
    let weight = select(max(last, LEAST_IMPORTANCE), LEAST_IMPORTANCE, is_nan(last));
    let whole = optical_depth_at(p);
    var ranks: array<u32, FOURS>;
    var rank = 0u;
    var in_front = 0.0;
    var before = 0.0;
    for (var bin = 0u; bin < BINS; bin++) {
        let n = f32(count_of(p, bin));
        let behind = whole * select(share_behind(kept_word(p, bin)), 1.0, bin == BINS - 1u);
        var price = 2.0 * log((in_front + 0.5 * n + 0.5) / weight);
        if (DIAPHANE_OUTPUTS > 1) {
            price = -(answer.y[bin] + last * prior_gain(max(n, 1.0), max(behind - before, 0.0), before, whole));
        }
        if (n > 0.0) {
            rank = max(rank, rank_of(price));
        }
        ranks[bin / 4u] |= rank << (8u * (bin & 3u));
        in_front += n;
        before = behind;
    }
    for (var i = 0u; i < FOURS; i++) {
        words[ranks_at(p, i)] = ranks[i];
    }
}
