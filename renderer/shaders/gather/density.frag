#version 450
// What the density tail reads of a pixel.
layout(early_fragment_tests) in;
#include "common/surface.glsl"
layout(location = 0) out vec4 sums;  // n, sum a, sum a^2, sum -ln(1-a)

void main() {
    uvec4 stored = stored_surface();
#if MIXED
    if (!is_transparent(stored)) discard;
#endif
    float a = float(stored.a) / 255.0;
    sums = vec4(1.0, a, a * a, -log(1.0 - a));
}
