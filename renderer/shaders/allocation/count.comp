#version 450
// Fragments of the open pixels at every edge: the bins of a round, in shared memory.
layout(local_size_x = 128) in;
#include "allocation/state.glsl"
#include "allocation/curve.glsl"

layout(std430, binding = 1) readonly buffer Counts { uint n[]; };
layout(std430, binding = 2) readonly buffer List { uint pixel[]; };
layout(std430, binding = 3) readonly buffer Curves { vec2 curve[]; };  // a and 1 / b
layout(std430, binding = 4) writeonly buffer Blocks { uint sums[]; };  // [blocks, EDGES]
const uint OWN = BLOCK / 128u;
shared float at[EDGES];
shared uint bin[EDGES];

void main() {
    uint lane = gl_LocalInvocationIndex;
    if (lane < EDGES) {
        at[lane] = price(edge[lane]);
        bin[lane] = 0u;
    }
    vec3 own[OWN];  // a, 1 / b, most; beyond the list there are none at any price
    for (uint i = 0u; i < OWN; ++i) {
        uint place = gl_WorkGroupID.x * BLOCK + i * 128u + lane;
        bool is_open = place < open_pixels;
        uint p = is_open ? pixel[place] : 0u;
        own[i] = is_open ? vec3(curve[p], float(usable(n[p]))) : vec3(0.0);
    }
    barrier();
    for (uint j = 0u; j < EDGES; ++j) {
        uint here = (j + lane) % EDGES;  // neighbours add to different bins
        float t = at[here];
        uint sum = 0u;
        for (uint i = 0u; i < OWN; ++i) sum += fragments_at(t, own[i].x, own[i].y, own[i].z);
        atomicAdd(bin[here], sum);
    }
    barrier();
    if (lane < EDGES) sums[gl_WorkGroupID.x * EDGES + lane] = bin[lane];
}
