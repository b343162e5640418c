#version 450
// The bundle's network on every occupied pixel, for the allocation within the frame: a and b of
// log gain(k) = a - b (k-1). With OUTPUTS 1 it answers an importance w (renderer/allocation/cuts.py: importance_curve).
layout(local_size_x = 64) in;
#include "allocation/state.glsl"
#include "allocation/bins.glsl"
#include "kbuffer-deep/inputs.glsl"

uniform uint pixels;

// `clamp`, and the given number for NaN, which a network that overflows can answer: clamp(NaN) may be anything. The bits
// are asked because a compiler may take it that a comparison never meets NaN.
float within(float x, float least, float most, float for_nan) {
    bool is_nan = (floatBitsToUint(x) & 0x7FFFFFFFu) > 0x7F800000u;
    return is_nan ? for_nan : clamp(x, least, most);
}

void main() {
    uint group = gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
    uint p = 64u * group + gl_LocalInvocationIndex;
    if (p >= pixels || complete == 1u) return;
    uint fragments = known_fragments(bins_of(p));
    if (fragments == 0u) return;
    float x[DIAPHANE_FEATURES];
    read_features(int(p), fragments, x);
#if OUTPUTS == 1
    precise float fall = 1.0 / within(diaphane_predict(x), 1.0 / float(MOST_FALL), 1.0, 1.0 / float(MOST_FALL));
    put_curve(p, vec2(max(-1.5 * fall, -float(MOST_GAIN)), fall));
#else
    vec2 gain = diaphane_predict(x).xy;
    float a = within(gain.x, -float(MOST_GAIN), float(MOST_GAIN), -float(MOST_GAIN));
    put_curve(p, vec2(a, within(gain.y, float(LEAST_FALL), float(MOST_FALL), float(MOST_FALL))));
#endif
}
