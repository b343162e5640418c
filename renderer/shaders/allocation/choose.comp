#version 450
// Which bin holds the budget; where the next round counts. One work group.
layout(local_size_x = 512) in;
#include "allocation/state.glsl"

layout(std430, binding = 4) readonly buffer Blocks { uint sums[]; };  // [blocks, EDGES]
const uint SLICES = 512u / EDGES;
shared uint part[512];
shared int found_low, found_high;

void main() {
    uint lane = gl_LocalInvocationIndex;
    uint rows = count_groups[0];
    if (rows == 0u) return;  // it is found
    uint own = 0u;
    for (uint row = lane / EDGES; row < rows; row += SLICES) own = add(own, sums[row * EDGES + lane % EDGES]);
    part[lane] = own;
    barrier();
    if (lane == 0u) {
        found_low = low;
        found_high = high;
        for (uint j = 0u; j < EDGES; ++j) {
            uint sum = 0u;
            for (uint slice = 0u; slice < SLICES; ++slice) sum = add(sum, part[slice * EDGES + j]);
            if (sum > budget) {
                found_high = edge[j];
                break;
            }
            found_low = edge[j];
            low_sum = sum;
        }
        low = found_low;
        high = found_high;
        warm = 1u;
        ++rounds;
        if (found_high - found_low <= 1) count_groups[0] = 0u;
    }
    barrier();
    if (lane < EDGES) edge[lane] = edge_between(found_low, found_high, int(lane));
}
