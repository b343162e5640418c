#version 450
// From the blocks' totals to what the frame has to solve, and where the first round counts.
layout(local_size_x = 256) in;
#include "allocation/state.glsl"

layout(std430, binding = 4) readonly buffer Blocks { uint sums[]; };  // [blocks, EDGES]: fragments, occupied, singles
uniform uint blocks;
uniform uint budget;
shared uvec3 part[256];

void start(uvec3 total) {
    k_min = uint(budget >= total.y);
    complete = uint(budget >= total.x);
    occupied = total.y;
    uint settled = k_min * total.z;
    open_pixels = complete == 1u ? 0u : occupied - settled;
    left = budget - min(budget, settled);
    low_sum = k_min * open_pixels;
    listed = 0u;
    rounds = 0u;
    count_groups[0] = (open_pixels + BLOCK - 1u) / BLOCK;
    count_groups[1] = count_groups[2] = 1u;
}

void main() {
    uint lane = gl_LocalInvocationIndex;
    uvec3 own = uvec3(0u);
    for (uint block = lane; block < blocks; block += 256u) {
        uint at = block * EDGES;
        own = uvec3(add(own.x, sums[at]), own.y + sums[at + 1u], own.z + sums[at + 2u]);
    }
    part[lane] = own;
    barrier();
    if (lane > 0u) return;
    for (uint i = 1u; i < 256u; ++i) own = uvec3(add(own.x, part[i].x), own.yz + part[i].yz);
    start(own);
    // A warm start counts closely around the last answer: if this frame's is there, the next round finds it.
    int first = low / EDGES * EDGES - EDGES * EDGES / 2;
    for (int j = 0; j < EDGES; ++j)
        edge[j] = warm == 1u ? clamp(first + EDGES * j, -LAST, LAST) : edge_between(-LAST, LAST, j);
    low = -LAST;
    high = LAST;
}
