#version 450
// How many fragments every triangle submits; drawn with `ranked`.
layout(early_fragment_tests) in;
#include "common/surface.glsl"

layout(std430, binding = 3) buffer Submitted { uint submitted[]; };  // of every triangle
uniform int first_triangle;

void main() {
#if MIXED
    if (!is_transparent(stored_surface())) return;
#endif
    atomicAdd(submitted[first_triangle + gl_PrimitiveID], 1u);
}
