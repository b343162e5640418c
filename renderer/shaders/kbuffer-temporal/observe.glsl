// What each fragment of a core's last bin changes of the displayed colour: the squared difference from the composite that
// has that bin in the tail, shared by them. By it the next frame corrects the ranks of the pixel's bins (correct.comp).
layout(std430, binding = 6) buffer Memory { uint memory[]; };  // [P]

// sRGB of linear light (IEC 61966-2-1).
vec3 displayed(vec3 linear) {
    vec3 c = clamp(linear, 0.0, 1.0);
    return mix(1.055 * pow(c, vec3(1.0 / 2.4)) - 0.055, 12.92 * c, lessThanEqual(c, vec3(0.0031308)));
}

// Whether a core's fragment lies in front of its last bin.
bool is_before_last(int p, uint slot) {
    float place = bin_place(uintBitsToFloat(slot_of(slot).y), range_of(ivec2(gl_FragCoord.xy), width));
    return uint(bin_of(place)) + 1u < bin_word[core_at(uint(p))] >> CURSOR_BITS;
}

// A core whose last bin has the slots from `first` to `end` is seen as `seen`; without them the core is `core`, and they
// join the tail's sums.
void observe(int p, uint first, uint end, vec3 seen, vec4 core, vec4 sums, vec4 opacity, vec3 behind) {
    uint word = memory[p];
    if (word == NOTHING) return;
    for (uint i = first; i < end; ++i) {
        uvec2 fragment = slot_of(i);
        float a = opacity_of(fragment.x), weight = tail_weight(p, a, uintBitsToFloat(fragment.y));
        sums += vec4(weight * decoded(fragment.x), weight);
        opacity += vec4(-log(1.0 - a), a, 1.0, 0.0);
    }
    vec3 change = displayed(seen) - displayed(composed(core, sums, opacity, behind));
    float gain = dot(change, change) / float(end - first);
    float least = exp(float(SEEN_LEAST));  // NaN is not above it either
    float steps = gain > least ? floor(float(SEEN_STEPS) * (log(gain) - float(SEEN_LEAST)) + 0.5) : 0.0;
    uint cut = bin_word[core_at(uint(p))] >> CURSOR_BITS;
    memory[p] = (word & ~SEEN_BITS) | uint(clamp(steps, 0.0, 255.0)) << 8 | cut << 16;
}
