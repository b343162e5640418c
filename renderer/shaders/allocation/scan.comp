#version 450
// Exclusive prefix sums over the blocks, in place. One work group: each thread has a run of them.
layout(local_size_x = 256) in;
#include "allocation/state.glsl"

layout(std430, binding = 4) buffer Blocks { uvec2 sums[]; };  // [blocks]
uniform uint blocks;
shared uvec2 part[256];

void main() {
    uint lane = gl_LocalInvocationIndex;
    uint run = (blocks + 255u) / 256u;
    uint first = min(lane * run, blocks), end = min(first + run, blocks);
    uvec2 own = uvec2(0u);
    for (uint i = first; i < end; ++i) own = add(own, sums[i]);
    part[lane] = own;
    barrier();
    if (lane == 0u) {
        uvec2 before = uvec2(0u);
        for (uint i = 0u; i < 256u; ++i) {
            uvec2 here = part[i];
            part[i] = before;
            before = add(before, here);
        }
    }
    barrier();
    uvec2 before = part[lane];
    for (uint i = first; i < end; ++i) {
        uvec2 here = sums[i];
        sums[i] = before;
        before = add(before, here);
    }
}
