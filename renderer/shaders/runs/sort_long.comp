#version 450
// Sorts one listed run a group, in place, by a bitonic network. Each of its comparisons puts the earlier fragment at the
// lower index, so that beyond the run's end there may be nothing; and 60,000 fragments take a thread 17,000 turns.
layout(local_size_x = 256) in;
#include "runs/runs.glsl"

layout(std430, binding = 2) readonly buffer Long { uint groups[3]; uint pixel[]; };

void order(uint i, uint j) {
    Fragment low = fragment_at(i), high = fragment_at(j);
    if (is_before(high, low)) {
        put(i, high);
        put(j, low);
    }
}

void main() {
    uvec2 run = run_of(pixel[gl_WorkGroupID.x]);
    uint n = run.y - run.x;
    uint pairs = 1u << findMSB(n - 1u);  // half of the next power of two
    for (uint reach = 1u; reach < n; reach *= 2u) {
        // Sorted halves of 2 reach become one: the first step compares from both ends, the others at half the distance.
        for (uint apart = reach; apart > 0u; apart /= 2u) {
            for (uint t = gl_LocalInvocationIndex; t < pairs; t += 256u) {
                uint inside = t % apart, block = t / apart * 2u * apart;
                uint i = block + inside, j = apart == reach ? block + 2u * apart - 1u - inside : i + apart;
                if (j < n) order(run.x + i, run.x + j);
            }
            memoryBarrierBuffer();
            barrier();
        }
    }
}
