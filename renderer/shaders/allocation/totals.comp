#version 450
// Fragments that can be in a core, and occupied pixels.
layout(local_size_x = 256) in;
#include "allocation/state.glsl"
#include "allocation/bins.glsl"

uniform uint pixels;
shared uint found, filled;

void main() {
    uint lane = gl_LocalInvocationIndex;
    if (lane == 0u) found = filled = 0u;
    barrier();
    uint sum = 0u, some = 0u;
    for (uint i = 0u; i < uint(BLOCK) / 256u; ++i) {
        uint p = gl_WorkGroupID.x * uint(BLOCK) + i * 256u + lane;
        if (p >= pixels || known_fragments(p) == 0u) continue;
        ++some;
        uint before = 0u;
        for (uint bin = 0u; bin < uint(BINS); ++bin) {
            uint own = usable(p, bin, before);
            if (own == uint(FULL)) break;
            before += own;
        }
        sum += before;
    }
    atomicAdd(found, sum);
    atomicAdd(filled, some);
    barrier();
    if (lane == 0u) {
        atomicAdd(fragments, found);
        atomicAdd(occupied, filled);
    }
}
