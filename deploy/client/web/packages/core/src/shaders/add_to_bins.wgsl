// Adds a fragment to its depth bin, one word, and its colour to its pixel's luma, another: one atomic exchange each
// (renderer/shaders/gather/bins.frag). `words`, [P][BINS], and `luma`, [P], are declared beside it, atomic.
fn units_in(optical_depth: f32) -> u32 {
    return u32(max(1.0, floor(optical_depth * OPTICAL_UNIT + 0.5)));
}

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
