#version 450
// Every transparent fragment becomes the new head of its pixel's list.
layout(early_fragment_tests) in;
#include "common/surface.glsl"

layout(std430, binding = 0) buffer Heads { uint head[]; };
layout(std430, binding = 1) writeonly buffer Nodes { uint node[]; };  // packed colour, depth bits, next
layout(std430, binding = 2) buffer Used { uint used; };
uniform int width;
uniform int first_row;

void main() {
    uvec4 stored = stored_surface();
#if MIXED
    if (!is_transparent(stored)) return;
#endif
    int p = (int(gl_FragCoord.y) - first_row) * width + int(gl_FragCoord.x);
    uint at = atomicAdd(used, 1u);
    node[3u * at] = pack(stored);
    node[3u * at + 1u] = floatBitsToUint(v_depth);
    node[3u * at + 2u] = atomicExchange(head[p], at);
}
