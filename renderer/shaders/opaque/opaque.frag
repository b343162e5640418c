#version 450
// The background of every technique: opaque fragments only, stored gamma-2 like the transparent ones.
#include "common/surface.glsl"
layout(location = 0) out vec4 out_colour;

void main() {
    uvec4 stored = stored_surface();
    if (stored.a < 255u) discard;
    out_colour = vec4(stored) / 255.0;
}
