#version 450
// The sum of the words before each, and of all. A thread reads and writes the same words: both buffers may be one.
layout(local_size_x = 256) in;
#include "prefix/sums.glsl"

layout(std430, binding = 0) readonly buffer Counts { uint count[]; };    // [items]
layout(std430, binding = 1) writeonly buffer Offsets { uint offset[]; };  // [items + 1]
const uint OWN = BLOCK / 256u;
shared uint part[256], row[16];

void main() {
    uint lane = gl_LocalInvocationIndex, block = gl_WorkGroupID.x;
    uint first = block * BLOCK + lane * OWN;
    uint words[OWN];
    uint own = 0u;
    for (uint i = 0u; i < OWN; ++i) {
        words[i] = first + i < items ? count[first + i] : 0u;
        own = add(own, words[i]);
    }
    part[lane] = own;
    barrier();
    if (lane < 16u) {  // exclusive sums in rows of 16; barriers are dear where a group's threads are loops
        uint all = 0u;
        for (uint i = 16u * lane; i < 16u * lane + 16u; ++i) {
            uint here = part[i];
            part[i] = all;
            all = add(all, here);
        }
        row[lane] = all;
    }
    barrier();
    uint before = add(sums[block].x, part[lane]);
    for (uint i = 0u; i < lane / 16u; ++i) before = add(before, row[i]);
    for (uint i = 0u; i < OWN; ++i) {
        if (first + i <= items) offset[first + i] = before;
        before = add(before, words[i]);
    }
}
