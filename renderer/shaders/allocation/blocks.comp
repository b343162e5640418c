#version 450
// Slots of every block, and by how many it grows at the next price.
layout(local_size_x = 256) in;
#include "allocation/state.glsl"
#include "allocation/curve.glsl"
#include "allocation/slots.glsl"

layout(std430, binding = 4) writeonly buffer Blocks { uvec2 sums[]; };  // [blocks]
shared uint sure, growth;

void main() {
    uint lane = gl_LocalInvocationIndex, block = gl_WorkGroupID.x;
    if (lane == 0u) sure = growth = 0u;
    barrier();
    uvec2 own = uvec2(0u);
    for (uint i = 0u; i < BLOCK / 256u; ++i) own += slots_of(block * BLOCK + i * 256u + lane);
    atomicAdd(sure, own.x);
    atomicAdd(growth, own.y);
    barrier();
    if (lane == 0u) sums[block] = uvec2(sure, growth);
}
