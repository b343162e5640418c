#version 450
// Lists the pixels of a band whose runs are LONG or longer, and how many groups sort them.
layout(local_size_x = 64) in;
#include "runs/runs.glsl"

layout(std430, binding = 2) buffer Long { uint groups[3]; uint pixel[]; };  // groups: 0, 1, 1 before
uniform uint first_pixel;
uniform uint pixels;  // of the band

void main() {
    uint i = gl_GlobalInvocationID.x + gl_GlobalInvocationID.y * gl_NumWorkGroups.x * 64u;
    if (i >= pixels) return;
    uvec2 run = run_of(first_pixel + i);
    if (run.y - run.x >= uint(LONG)) pixel[atomicAdd(groups[0], 1u)] = first_pixel + i;
}
