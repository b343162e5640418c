#version 450
// Composites each pixel's sorted list front to back.
#include "common/composite.glsl"

layout(std430, binding = 0) readonly buffer Heads { uint head[]; };
layout(std430, binding = 1) readonly buffer Nodes { uint node[]; };  // packed colour, depth bits, next
layout(binding = 0) uniform sampler2D background;
uniform int width;
uniform int first_row;
layout(location = 0) out vec4 out_colour;

const uint END = 0xFFFFFFFFu;

void main() {
    if (gl_HelperInvocation) return;  // drivers may read zeros there, and a link to node 0 would never end
    ivec2 xy = ivec2(gl_FragCoord.xy);
    vec4 light = vec4(0.0, 0.0, 0.0, 1.0);
    for (uint at = head[(xy.y - first_row) * width + xy.x]; at != END; at = node[3u * at + 2u]) {
        add_behind(node[3u * at], light);
    }
    out_colour = vec4(over(light, texelFetch(background, xy, 0).rgb), 1.0);
}
