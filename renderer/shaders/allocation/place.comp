#version 450
// Where each pixel's core lies in the pool. What is left of the budget goes to the pixels that grow at the chosen rank,
// by index, until one does not fit. The counts have served: their first word becomes the cut, the second a cursor.
layout(local_size_x = 256) in;
#include "allocation/state.glsl"
#include "allocation/bins.glsl"
#include "allocation/rank.glsl"
#include "allocation/cut.glsl"

layout(std430, binding = 3) readonly buffer Blocks { uvec2 sums[]; };     // [blocks], before each
layout(std430, binding = 4) writeonly buffer Offsets { uint offset[]; };  // [P]
const uint OWN = uint(BLOCK) / 256u;
shared uvec2 part[256];

void main() {
    uint lane = gl_LocalInvocationIndex, block = gl_WorkGroupID.x;
    uint first = block * uint(BLOCK) + lane * OWN;
    Cut cuts[OWN];
    uvec2 own = uvec2(0u);
    for (uint i = 0u; i < OWN; ++i) {
        cuts[i] = cut_of(first + i);
        own += uvec2(cuts[i].fragments, cuts[i].more_fragments - cuts[i].fragments);
    }
    part[lane] = own;
    for (uint reach = 1u; reach < 256u; reach *= 2u) {
        barrier();
        uvec2 other = lane >= reach ? part[lane - reach] : uvec2(0u);
        barrier();
        part[lane] += other;
    }
    uvec2 before = sums[block] + part[lane] - own;
    uint spare = complete == 1u ? 0u : budget - spent;
    for (uint i = 0u; i < OWN; ++i) {
        uint p = first + i;
        if (p >= pixels) return;
        uint growth = cuts[i].more_fragments - cuts[i].fragments;
        bool grows = before.y + growth <= spare;
        offset[p] = before.x + min(before.y, spare);
        counts[p * uint(FOURS)] = grows ? cuts[i].more_bins : cuts[i].bins;
        counts[p * uint(FOURS) + 1u] = before.x + min(before.y, spare);
        before += uvec2(cuts[i].fragments, growth);
    }
}
