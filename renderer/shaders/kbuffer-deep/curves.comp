#version 450
// The bundle's network on the gathered sums of every pixel with fragments, for the allocation within the frame: a and 1 / b of
// log gain(k) = a - b (k-1). Pixels without fragments have none; 1 / b is stored so that every later pass
// has the same number. With OUTPUTS 1 the network answers an importance w, whose curve is k = floor(t w) at the price t
// (renderer/allocation/lattice.py: importance_curves).
layout(local_size_x = 64) in;
#include "allocation/state.glsl"
#include "kbuffer-deep/inputs.glsl"

layout(std430, binding = 5) writeonly buffer Curves { vec2 curve[]; };  // [P], a and 1 / b

uniform uint pixels;

// `clamp`, and the least for NaN, which a network that overflows can answer: clamp(NaN) may be anything, and where a curve
// is NaN no price uses the budget. The bits are asked because a compiler may take it that a comparison never meets NaN.
float within(float x, float least, float most) {
    bool is_nan = (floatBitsToUint(x) & 0x7FFFFFFFu) > 0x7F800000u;
    return is_nan ? least : clamp(x, least, most);
}

void main() {
    uint group = gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
    uint p = 64u * group + gl_LocalInvocationIndex;
    if (p >= pixels || complete == 1u || count[p] == 0u) return;
    float x[DIAPHANE_FEATURES];
    read_features(int(p), x);
#if OUTPUTS == 1
    float w = within(diaphane_predict(x), LEAST_RATE, MOST_RATE);
    curve[p] = vec2(-1.5 / w, w);
#else
    vec2 gain = diaphane_predict(x).xy;
    curve[p] = vec2(within(gain.x, -MOST_GAIN, MOST_GAIN), within(1.0 / gain.y, LEAST_RATE, MOST_RATE));
#endif
}
