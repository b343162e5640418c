#version 450
// The sum and the greatest word of every block.
layout(local_size_x = 256) in;
#include "prefix/sums.glsl"

layout(std430, binding = 0) readonly buffer Counts { uint count[]; };  // [items]
shared uvec2 part[256];

void main() {
    uint lane = gl_LocalInvocationIndex, block = gl_WorkGroupID.x;
    uvec2 own = uvec2(0u);
    for (uint i = 0u; i < BLOCK / 256u; ++i) {
        uint at = block * BLOCK + i * 256u + lane;
        uint word = at < items ? count[at] : 0u;
        own = uvec2(add(own.x, word), max(own.y, word));
    }
    part[lane] = own;
    barrier();
    if (lane < 16u) {
        for (uint i = 16u + lane; i < 256u; i += 16u) own = uvec2(add(own.x, part[i].x), max(own.y, part[i].y));
        part[lane] = own;
    }
    barrier();
    if (lane > 0u) return;
    for (uint i = 1u; i < 16u; ++i) own = uvec2(add(own.x, part[i].x), max(own.y, part[i].y));
    sums[block] = own;
}
