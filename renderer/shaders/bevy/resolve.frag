#version 450
// NODES fragments sorted; with one too many, the nearest of them is blended early (renderer/techniques/bevy.py).
#include "ordered/runs.glsl"
#include "ordered/arrived.glsl"
layout(location = 0) out vec4 out_colour;

// Depth, then opacity: the engine packs both into one word.
bool is_nearer(uvec2 a, uvec2 b) {
    return a.x < b.x || a.x == b.x && a.y >> 24 > b.y >> 24;
}

void main() {
    uvec2 kept[NODES];  // depth bits, packed colour; nearest first
    for (int i = 0; i < NODES; ++i) kept[i] = uvec2(EMPTY, 0u);
    uint p = uint(int(gl_FragCoord.y) * width + int(gl_FragCoord.x));
    uvec2 found = run();
    int count = 0;
    vec4 light = vec4(0.0, 0.0, 0.0, 1.0);
    for (uint j = found.y; j > found.x; --j) {
        Fragment next = fragment_at(j - 1u);
        if (!has_arrived(next.rank, p)) continue;
        uvec2 carried = uvec2(next.depth, next.colour);
        bool placed = false;
        if (count < NODES) {
            ++count;
            for (int i = 0; i < NODES; ++i) {
                placed = placed || is_nearer(carried, kept[i]);
                if (placed) {
                    uvec2 farther = kept[i];
                    kept[i] = carried;
                    carried = farther;
                }
            }
        } else if (is_nearer(kept[0], carried)) {
            add_behind(kept[0].y, light);
            for (int i = 0; i < NODES; ++i) {
                if (placed) continue;
                placed = i == NODES - 1 || !is_nearer(kept[min(i + 1, NODES - 1)], carried);
                kept[i] = placed ? carried : kept[min(i + 1, NODES - 1)];
            }
        } else {
            add_behind(carried.y, light);
        }
    }
    for (int i = 0; i < NODES; ++i) add_behind(kept[i].y, light);
    out_colour = over_background(light);
}
