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
    for (uint half_way = 128u; half_way > 0u; half_way /= 2u) {
        barrier();
        if (lane < half_way) {
            uvec2 other = part[lane + half_way];
            part[lane] = uvec2(add(part[lane].x, other.x), max(part[lane].y, other.y));
        }
    }
    if (lane == 0u) sums[block] = part[0];
}
