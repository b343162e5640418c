#version 450
// Exclusive prefix sums over the blocks, in place. One work group: each thread has a run of them.
layout(local_size_x = 256) in;
#include "prefix/sums.glsl"

uniform uint blocks;
shared uvec2 part[256];

void main() {
    uint lane = gl_LocalInvocationIndex;
    uint run = (blocks + 255u) / 256u;
    uint first = min(lane * run, blocks), end = min(first + run, blocks);
    uvec2 own = uvec2(0u);
    for (uint i = first; i < end; ++i) own = uvec2(add(own.x, sums[i].x), max(own.y, sums[i].y));
    part[lane] = own;
    barrier();
    if (lane == 0u) {
        uvec2 all = uvec2(0u);
        for (uint i = 0u; i < 256u; ++i) {
            uvec2 here = part[i];
            part[i].x = all.x;
            all = uvec2(add(all.x, here.x), max(all.y, here.y));
        }
        sums[blocks] = all;
    }
    barrier();
    uint before = part[lane].x;
    for (uint i = first; i < end; ++i) {
        uint here = sums[i].x;
        sums[i].x = before;
        before = add(before, here);
    }
}
