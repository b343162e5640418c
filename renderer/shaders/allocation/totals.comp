#version 450
// Fragments and occupied pixels of every block.
layout(local_size_x = 256) in;
#include "allocation/state.glsl"

layout(std430, binding = 1) readonly buffer Counts { uint n[]; };
layout(std430, binding = 4) writeonly buffer Blocks { uint sums[]; };  // [blocks, EDGES], two are used
uniform uint pixels;
shared uint fragments, filled;

void main() {
    uint lane = gl_LocalInvocationIndex, block = gl_WorkGroupID.x;
    if (lane == 0u) fragments = filled = 0u;
    barrier();
    uvec2 own = uvec2(0u);
    for (uint i = 0u; i < BLOCK / 256u; ++i) {
        uint p = block * BLOCK + i * 256u + lane;
        uint count = p < pixels ? usable(n[p]) : 0u;
        own += uvec2(count, min(count, 1u));
    }
    atomicAdd(fragments, own.x);
    atomicAdd(filled, own.y);
    barrier();
    if (lane == 0u) {
        sums[block * EDGES] = fragments;
        sums[block * EDGES + 1u] = filled;
    }
}
