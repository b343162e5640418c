#version 450
// Fragments, occupied pixels and pixels of one fragment of every block.
layout(local_size_x = 256) in;
#include "allocation/state.glsl"

layout(std430, binding = 1) readonly buffer Counts { uint n[]; };
layout(std430, binding = 4) writeonly buffer Blocks { uint sums[]; };  // [blocks, EDGES], three are used
uniform uint pixels;
shared uint fragments, filled, singles;

void main() {
    uint lane = gl_LocalInvocationIndex, block = gl_WorkGroupID.x;
    if (lane == 0u) fragments = filled = singles = 0u;
    barrier();
    uvec3 own = uvec3(0u);
    for (uint i = 0u; i < BLOCK / 256u; ++i) {
        uint p = block * BLOCK + i * 256u + lane;
        uint count = p < pixels ? usable(n[p]) : 0u;
        own += uvec3(count, min(count, 1u), uint(count == 1u));
    }
    atomicAdd(fragments, own.x);
    atomicAdd(filled, own.y);
    atomicAdd(singles, own.z);
    barrier();
    if (lane == 0u) {
        sums[block * EDGES] = fragments;
        sums[block * EDGES + 1u] = filled;
        sums[block * EDGES + 2u] = singles;
    }
}
