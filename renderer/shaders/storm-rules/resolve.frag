#version 450
// The NODES fragments that arrived last, sorted; the others are not read (renderer/techniques/storm_rules.py).
#include "ordered/runs.glsl"
#include "ordered/arrived.glsl"
layout(location = 0) out vec4 out_colour;

void main() {
    uvec2 kept[NODES];  // depth bits, packed colour; nearest first
    for (int i = 0; i < NODES; ++i) kept[i] = uvec2(EMPTY, 0u);
    uint p = uint(int(gl_FragCoord.y) * width + int(gl_FragCoord.x));
    uvec2 found = run();
    int count = 0;
    for (uint j = found.y; j > found.x && count < NODES; --j) {
        Fragment next = fragment_at(j - 1u);
        if (!has_arrived(next.rank, p)) continue;
        ++count;
        uvec2 carried = uvec2(next.depth, next.colour);
        bool placed = false;  // behind all that are as deep
        for (int i = 0; i < NODES; ++i) {
            placed = placed || carried.x < kept[i].x;
            if (placed) {
                uvec2 farther = kept[i];
                kept[i] = carried;
                carried = farther;
            }
        }
    }
    vec4 light = vec4(0.0, 0.0, 0.0, 1.0);
    for (int i = 0; i < NODES; ++i) add_behind(kept[i].y, light);
    out_colour = over_background(light);
}
