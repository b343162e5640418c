#version 450
// Every colour weighted by its opacity and the share of samples in which nothing hides it; the optical depth.
layout(early_fragment_tests) in;
#include "common/surface.glsl"
#include "common/log1p.glsl"

layout(std430, binding = 0) readonly buffer Samples { uint nearest[]; };  // SAMPLES a pixel, of a band of rows
uniform int width;
uniform int first_row;
layout(location = 0) out vec4 colours;  // sum a V C, sum a V; V is the visibility
layout(location = 1) out float depth;   // sum -ln(1-a)

void main() {
    uvec4 stored = stored_surface();
#if MIXED
    if (!is_transparent(stored)) discard;
#endif
    uint first = uint((int(gl_FragCoord.y) - first_row) * width + int(gl_FragCoord.x)) * uint(SAMPLES);
    uint z = floatBitsToUint(v_depth);
    uint seen = 0u;
    for (uint i = 0u; i < uint(SAMPLES); ++i) seen += uint(z <= nearest[first + i]);
    float a = float(stored.a) / 255.0;
    vec3 root = vec3(stored.rgb) / 255.0;
    float weight = a * float(seen) / float(SAMPLES);
    colours = vec4(weight * root * root, weight);
    depth = optical_depth(a);
}
