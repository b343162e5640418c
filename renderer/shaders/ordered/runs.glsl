// A pixel's fragments in the order of submission (renderer/techniques/ordered.py), for the passes over pixels.
#include "common/composite.glsl"

layout(std430, binding = 0) readonly buffer Offsets { uint offset[]; };  // [pixels of the band + 1]
layout(std430, binding = 1) readonly buffer Depths { uint depth[]; };    // float bits: they order as the floats do
layout(std430, binding = 2) readonly buffer Colours { uint colour[]; };  // packed
layout(binding = 0) uniform sampler2D background;
uniform int width;
uniform int first_row;

// First fragment of this pixel, and the one after its last.
uvec2 run() {
    if (gl_HelperInvocation) return uvec2(0u);  // beyond the window's edge there are no offsets
    int p = (int(gl_FragCoord.y) - first_row) * width + int(gl_FragCoord.x);
    return uvec2(offset[p], offset[p + 1]);
}

vec4 over_background(vec4 light) {
    return vec4(over(light, texelFetch(background, ivec2(gl_FragCoord.xy), 0).rgb), 1.0);
}
