#version 450
// Where each pixel's run of slots begins. What is left of the budget goes to the pixels that grow at the next price, in
// the order of their index; so the slots before pixel p are those at `low` before it, and as much of the growth before
// it as there is budget for.
layout(local_size_x = 256) in;
#include "allocation/state.glsl"
#include "allocation/curve.glsl"
#include "allocation/slots.glsl"

layout(std430, binding = 2) writeonly buffer Offsets { uint offset[]; };  // [pixels + 1]
layout(std430, binding = 4) readonly buffer Blocks { uvec2 sums[]; };     // [blocks], before each
const uint OWN = BLOCK / 256u;
shared uvec2 part[256];

void main() {
    uint lane = gl_LocalInvocationIndex, block = gl_WorkGroupID.x;
    uint first = block * BLOCK + lane * OWN;
    uvec2 slots[OWN];
    uvec2 own = uvec2(0u);
    for (uint i = 0u; i < OWN; ++i) {
        slots[i] = slots_of(first + i);
        own += slots[i];
    }
    part[lane] = own;
    for (uint reach = 1u; reach < 256u; reach *= 2u) {
        barrier();
        uvec2 other = lane >= reach ? part[lane - reach] : uvec2(0u);
        barrier();
        part[lane] += other;
    }
    uvec2 before = add(sums[block], part[lane] - own);
    uint spare = complete == 1u ? 0u : budget - low_sum;
    for (uint i = 0u; i < OWN; ++i) {
        uint p = first + i;
        if (p <= pixels) offset[p] = before.x + min(before.y, spare);
        before = add(before, slots[i]);
    }
}
