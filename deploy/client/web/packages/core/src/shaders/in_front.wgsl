// What the depth bins know to be in front of a fragment (renderer/shaders/kbuffer/tail.glsl).
// Optical depth in front of a fragment: all of the bins before its own, and of its own bin's others as much as lies
// before it if they are spread evenly around their mean.
fn in_front(p: u32, place: f32, own: f32) -> f32 {
    let bin = bin_of(place);
    let total = optical_depth_at(p);
    let s = place - f32(bin);
    let word = kept_word(p, bin);
    let is_last = bin == BINS - 1u;
    var before = 0.0;
    if (bin > 0u) {
        before = total * share_behind(kept_word(p, bin - 1u));
    }
    let within = select(total * share_behind(word), total, is_last) - before;
    let others = max(within - own, 0.0);
    var middle = 0.5;
    if (others > LEAST_OTHERS) {
        middle = clamp((within * select(mean_in(word), 0.5, is_last) - own * s) / others, 0.0, 1.0);
    }
    let spread = max(min(middle, 1.0 - middle), LEAST_SPREAD);
    return before + others * clamp((s - (middle - spread)) / (2.0 * spread), 0.0, 1.0);
}
