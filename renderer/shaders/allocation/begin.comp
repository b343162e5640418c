#version 450
// From the blocks' totals to what the frame has to solve, and where the first round counts.
layout(local_size_x = 256) in;
#include "allocation/state.glsl"

layout(std430, binding = 4) readonly buffer Blocks { uint sums[]; };  // [blocks, EDGES]: fragments, occupied
uniform uint blocks;
uniform uint fragments;
shared uvec2 part[256];

void start(uvec2 total) {
    budget = fragments;
    complete = uint(budget >= total.x);
    open_pixels = complete == 1u ? 0u : total.y;
    low_sum = 0u;
    listed = 0u;
    rounds = 0u;
    count_groups[0] = (open_pixels + BLOCK - 1u) / BLOCK;
    count_groups[1] = count_groups[2] = 1u;
}

void main() {
    uint lane = gl_LocalInvocationIndex;
    uvec2 own = uvec2(0u);
    for (uint block = lane; block < blocks; block += 256u) {
        uint at = block * EDGES;
        own = uvec2(add(own.x, sums[at]), own.y + sums[at + 1u]);
    }
    part[lane] = own;
    barrier();
    if (lane > 0u) return;
    for (uint i = 1u; i < 256u; ++i) own = uvec2(add(own.x, part[i].x), own.y + part[i].y);
    start(own);
    // A warm start counts closely around the last answer: if this frame's is there, the next round finds it.
    int first = low / EDGES * EDGES - EDGES * EDGES / 2;
    for (int j = 0; j < EDGES; ++j)
        edge[j] = warm == 1u ? clamp(first + EDGES * j, -LAST, LAST) : edge_between(-LAST, LAST, j);
    low = -LAST;
    high = LAST;
}
