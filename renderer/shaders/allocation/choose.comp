#version 450
// Which half of a rank the budget ends in. STEP 0: whether there is anything to choose; 1: the first half; 2: the second.
layout(local_size_x = 256) in;
#include "allocation/state.glsl"

const uint SIZE = 1u << HALF_BITS;
const uint OWN = SIZE / 256u;
shared uint part[256];

void main() {
    uint lane = gl_LocalInvocationIndex;
#if STEP
    if (complete == 1u) return;
    uint own = 0u;
    for (uint i = 0u; i < OWN; ++i) own += counted[lane * OWN + i];
    part[lane] = own;
    barrier();
    uint before = spent;
    barrier();
    for (uint i = 0u; i < lane; ++i) before += part[i];
    // Exactly one thread's run has the first number with which it is too much.
    if (before <= budget && before + own > budget) {
        uint i = lane * OWN;
        for (; before + counted[i] <= budget; ++i) before += counted[i];
        spent = before;
#if STEP == 1
        high = i;
#else
        rank = high << uint(HALF_BITS) | i;
#endif
    }
    barrier();
#else
    if (lane == 0u) complete = uint(fragments <= budget);
#endif
    for (uint i = 0u; i < OWN; ++i) counted[lane * OWN + i] = 0u;
}
