#version 450
// Composites each pixel's sorted array front to back.
#include "common/composite.glsl"

layout(std430, binding = 0) readonly buffer Used { uint used[]; };  // of the window
layout(std430, binding = 1) readonly buffer Slots { uvec2 slot[]; };  // packed colour, depth bits
layout(binding = 0) uniform sampler2D background;
uniform int width;
uniform int first_row;
uniform int slots;
layout(location = 0) out vec4 out_colour;

void main() {
    if (gl_HelperInvocation) return;  // beyond the window's edge there are no counts, and the loop would go anywhere
    ivec2 xy = ivec2(gl_FragCoord.xy);
    int p = xy.y * width + xy.x;
    uint base = uint(p - first_row * width) * uint(slots);
    vec4 light = vec4(0.0, 0.0, 0.0, 1.0);
    for (uint i = base, end = base + used[p]; i < end; ++i) add_behind(slot[i].x, light);
    out_colour = vec4(over(light, texelFetch(background, xy, 0).rgb), 1.0);
}
