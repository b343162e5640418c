#version 450
// The pixels with fragments, in any order: what follows costs nothing for the others.
layout(local_size_x = 256) in;
#include "allocation/state.glsl"

layout(std430, binding = 1) readonly buffer Counts { uint n[]; };
layout(std430, binding = 2) writeonly buffer List { uint pixel[]; };
uniform uint pixels;
shared uint found, base;

void main() {
    if (complete == 1u) return;
    uint lane = gl_LocalInvocationIndex;
    if (lane == 0u) found = 0u;
    barrier();
    uint own[BLOCK / 256u];
    for (uint i = 0u; i < BLOCK / 256u; ++i) {
        uint p = gl_WorkGroupID.x * BLOCK + i * 256u + lane;
        own[i] = p < pixels && n[p] > 0u ? atomicAdd(found, 1u) : CEILING;
    }
    barrier();
    if (lane == 0u) base = atomicAdd(listed, found);
    barrier();
    for (uint i = 0u; i < BLOCK / 256u; ++i)
        if (own[i] != CEILING) pixel[base + own[i]] = gl_WorkGroupID.x * BLOCK + i * 256u + lane;
}
