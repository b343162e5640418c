#version 450
// The rank that the budget ends in.
layout(local_size_x = 256) in;
#include "allocation/state.glsl"

const uint OWN = uint(RANKS) / 256u;
shared uint part[256];

void main() {
    if (complete == 1u) return;
    uint lane = gl_LocalInvocationIndex, own = 0u;
    for (uint i = 0u; i < OWN; ++i) own += counted[lane * OWN + i];
    part[lane] = own;
    barrier();
    uint before = 0u;
    for (uint i = 0u; i < lane; ++i) before += part[i];
    // Exactly one thread's run has the first number with which it is too much.
    if (before <= budget && before + own > budget) {
        uint i = lane * OWN;
        for (; before + counted[i] <= budget; ++i) before += counted[i];
        spent = before;
        rank = i;
    }
}
