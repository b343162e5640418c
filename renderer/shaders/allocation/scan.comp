#version 450
// Exclusive prefix sums over the blocks, in place. One work group: each thread has a run of them.
layout(local_size_x = 256) in;

layout(std430, binding = 3) buffer Blocks { uvec2 sums[]; };  // [blocks]
uniform uint blocks;
shared uvec2 part[256];

void main() {
    uint lane = gl_LocalInvocationIndex;
    uint run = (blocks + 255u) / 256u;
    uint first = min(lane * run, blocks), end = min(first + run, blocks);
    uvec2 own = uvec2(0u);
    for (uint i = first; i < end; ++i) own += sums[i];
    part[lane] = own;
    barrier();
    uvec2 before = uvec2(0u);
    for (uint i = 0u; i < lane; ++i) before += part[i];
    for (uint i = first; i < end; ++i) {
        uvec2 here = sums[i];
        sums[i] = before;
        before += here;
    }
}
