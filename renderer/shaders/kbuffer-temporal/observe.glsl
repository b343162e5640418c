// What the last core fragment of a pixel changes of its displayed colour: the squared difference from the composite that
// has it in the tail. By it the next frame corrects the ranks of the pixel's bins (correct.comp).
layout(std430, binding = 6) buffer Memory { uint memory[]; };  // [P]

// sRGB of linear light (IEC 61966-2-1).
vec3 displayed(vec3 linear) {
    vec3 c = clamp(linear, 0.0, 1.0);
    return mix(1.055 * pow(c, vec3(1.0 / 2.4)) - 0.055, 12.92 * c, lessThanEqual(c, vec3(0.0031308)));
}

// A core whose last fragment is in `slot` is seen as `seen`; without it the core is `core`, and it joins the tail's sums.
void observe(int p, uint slot, vec3 seen, vec4 core, vec4 sums, vec4 opacity, vec3 behind) {
    uint word = memory[p];
    if (word == NOTHING) return;
    uvec2 fragment = slot_of(slot);
    uint stored = fragment.x;
    float a = opacity_of(stored), weight = tail_weight(p, a, uintBitsToFloat(fragment.y));
    sums += vec4(weight * decoded(stored), weight);
    opacity += vec4(-log(1.0 - a), a, 1.0, 0.0);
    vec3 change = displayed(seen) - displayed(composed(core, sums, opacity, behind));
    float gain = dot(change, change);
    float least = exp(float(SEEN_LEAST));  // NaN is not above it either
    float steps = gain > least ? floor(float(SEEN_STEPS) * (log(gain) - float(SEEN_LEAST)) + 0.5) : 0.0;
    uint cut = bin_word[core_at(uint(p))] >> CURSOR_BITS;
    memory[p] = (word & ~SEEN_BITS) | uint(clamp(steps, 0.0, 255.0)) << 8 | cut << 16;
}
