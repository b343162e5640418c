#version 450
// The cut of every pixel, in place of its ranks, and fragments of every block of pixels: granted, and what they grow by
// at the chosen rank.
layout(local_size_x = 256) in;
#include "allocation/state.glsl"
#include "allocation/bins.glsl"
#include "allocation/cut.glsl"

layout(std430, binding = 3) writeonly buffer Blocks { uvec2 sums[]; };  // [blocks]
uniform uint pixels;
shared uint sure, growth;

void main() {
    uint lane = gl_LocalInvocationIndex, block = gl_WorkGroupID.x;
    if (lane == 0u) sure = growth = 0u;
    barrier();
    uvec2 own = uvec2(0u);
    for (uint i = 0u; i < uint(BLOCK) / 256u; ++i) {
        uint p = block * uint(BLOCK) + i * 256u + lane;
        if (p >= pixels) continue;
        Cut cut = cut_of(p);
        bin_word[cut_at(p)] = packed_cut(cut);
        own += uvec2(cut.fragments, cut.more_fragments - cut.fragments);
    }
    atomicAdd(sure, own.x);
    atomicAdd(growth, own.y);
    barrier();
    if (lane == 0u) sums[block] = uvec2(sure, growth);
}
