#version 450
// Power moments of the warped depth, weighted by absorbance -ln(1-a), by additive blending.
layout(early_fragment_tests) in;
#include "common/surface.glsl"
#include "moment/warp.glsl"

uniform int width;
layout(location = 0) out float total;   // b0
layout(location = 1) out vec4 moments;  // b1..b4

void main() {
    uvec4 stored = stored_surface();
#if MIXED
    if (!is_transparent(stored)) discard;
#endif
    float absorbance = optical_depth(float(stored.a) / 255.0);
    float x = warped_depth(int(gl_FragCoord.y) * width + int(gl_FragCoord.x), v_depth);
    float x2 = x * x;
    total = absorbance;
    moments = absorbance * vec4(x, x2, x2 * x, x2 * x2);
}
