#version 450
// Multi-layer alpha blending (Salvi and Vaidyanathan 2014, section 3): NODES nodes per pixel, in registers.
#include "ordered/runs.glsl"
layout(location = 0) out vec4 out_colour;

bool is_nearer(uvec2 a, uvec2 b) {
    return a.x < b.x || a.x == b.x && a.y < b.y;
}

void main() {
    uvec2 key[NODES];   // depth bits, packed colour; nearest first
    vec4 layer[NODES];  // premultiplied linear RGB, transmittance
    for (int i = 0; i < NODES; ++i) {
        key[i] = uvec2(EMPTY);
        layer[i] = vec4(0.0, 0.0, 0.0, 1.0);
    }
    uvec2 found = run();
    for (uint j = found.x; j < found.y; ++j) {
        Fragment next = fragment_at(j);
        float a = opacity_of(next.colour);
        uvec2 carried_key = uvec2(next.depth, next.colour);
        vec4 carried = vec4(a * decoded(next.colour), 1.0 - a);
        bool placed = false;  // all that is behind it moves, also a layer that is as deep as the next one
        for (int i = 0; i < NODES; ++i) {
            placed = placed || is_nearer(carried_key, key[i]);
            if (placed) {
                uvec2 farther_key = key[i];
                vec4 farther = layer[i];
                key[i] = carried_key;
                layer[i] = carried;
                carried_key = farther_key;
                carried = farther;
            }
        }
        // What is carried out is the farthest of NODES + 1: it merges into the last one. An empty one changes nothing.
        vec4 last = layer[NODES - 1];
        layer[NODES - 1] = vec4(last.rgb + last.a * carried.rgb, last.a * carried.a);
    }
    vec4 light = vec4(0.0, 0.0, 0.0, 1.0);
    for (int i = 0; i < NODES; ++i) light = vec4(light.rgb + light.a * layer[i].rgb, light.a * layer[i].a);
    out_colour = over_background(light);
}
