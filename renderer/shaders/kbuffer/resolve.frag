#version 450
// Core front to back, then the tail, then the background (METHOD 2). Linear RGB out.
// TAIL: -1 none (the pool holds every fragment), else as in tail.glsl. STRIDE: words of a slot; the first is the colour.
#include "common/composite.glsl"
#if TAIL == 4
#include "common/depth_bins.glsl"
#endif

layout(std430, binding = 0) readonly buffer Offsets { uint offset[]; };  // [P+1]
layout(std430, binding = 2) readonly buffer Colours { uint colour[]; };
layout(binding = 0) uniform sampler2D background;
#if TAIL >= 0
layout(binding = 1) uniform sampler2D tail_colour;
#if TAIL == 4
layout(std430, binding = 5) readonly buffer DepthBins { uint kept[]; };  // [P, WORDS]; the first is D
#else
layout(binding = 2) uniform sampler2D tail_opacity;
#endif
#endif
uniform int width;
uniform int first_row;  // of the pool
layout(location = 0) out vec4 out_colour;

void main() {
    if (gl_HelperInvocation) return;  // beyond the window's edge there are no offsets, and loops would go anywhere
    ivec2 xy = ivec2(gl_FragCoord.xy);
    int p = (xy.y - first_row) * width + xy.x;
    vec4 light = vec4(0.0, 0.0, 0.0, 1.0);
    for (uint i = offset[p], end = offset[p + 1]; i < end; ++i) {
        uint word = colour[STRIDE * i];
        if (word == EMPTY) break;  // the pixel has fewer fragments than slots
        add_behind(word, light);
    }
    vec3 behind = texelFetch(background, xy, 0).rgb;
    behind *= behind;
#if TAIL >= 0
    vec4 sums = texelFetch(tail_colour, xy, 0);
#if TAIL == 4
    if (sums.a > 0.0) {  // T_core P is what the whole list lets through, exp(-D)
        float through = min(exp(-uintBitsToFloat(kept[WORDS * uint(p)])), light.a);
        out_colour = vec4(light.rgb + (light.a - through) / sums.a * sums.rgb + through * behind, 1.0);
        return;
    }
#else
    vec4 opacity = texelFetch(tail_opacity, xy, 0);
    if (opacity.z > 0.0) {
        vec3 average = sums.rgb / sums.a;
#if TAIL == 0 || TAIL == 1
        float through = exp(-opacity.x);  // P = prod (1 - a)
#else
        float through = pow(max(1.0 - opacity.y / opacity.z, 0.0), opacity.z);  // P = (1 - A/t)^t
#endif
#if TAIL == 3
        behind = average + through * behind;  // as DHOIT prints it
#else
        behind = (1.0 - through) * average + through * behind;
#endif
    }
#endif
#endif
    out_colour = vec4(light.rgb + light.a * behind, 1.0);
}
