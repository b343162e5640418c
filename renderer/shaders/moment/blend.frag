#version 450
// Every colour weighted by its opacity and the transmittance that the moments give at its depth.
layout(early_fragment_tests) in;
#include "common/surface.glsl"
#include "moment/warp.glsl"
#include "moment/reconstruct.glsl"

layout(binding = 0) uniform sampler2D totals;  // b0
layout(binding = 1) uniform sampler2D moments;  // b1..b4
uniform int width;
layout(location = 0) out vec4 colours;  // sum a T C, sum a T

void main() {
    uvec4 stored = stored_surface();
#if MIXED
    if (!is_transparent(stored)) discard;
#endif
    ivec2 xy = ivec2(gl_FragCoord.xy);
    float total = texelFetch(totals, xy, 0).r;
    Distribution d = distribution_of(texelFetch(moments, xy, 0) / total);
    float a = float(stored.a) / 255.0;
    vec3 root = vec3(stored.rgb) / 255.0;
    float weight = a * visibility(d, total, warped_depth(xy.y * width + xy.x, v_depth));
    colours = vec4(weight * root * root, weight);
}
