#version 450
// Every colour weighted by its opacity and the transmittance that the coefficients give in front of it.
layout(early_fragment_tests) in;
#include "common/surface.glsl"
#include "wavelet/place.glsl"

layout(binding = 0) uniform sampler2D part0;
layout(binding = 1) uniform sampler2D part1;
layout(binding = 2) uniform sampler2D part2;
layout(binding = 3) uniform sampler2D part3;
uniform int width;
layout(location = 0) out vec4 colours;  // sum a T C, sum a T

void main() {
    uvec4 stored = stored_surface();
#if MIXED
    if (!is_transparent(stored)) discard;
#endif
    ivec2 xy = ivec2(gl_FragCoord.xy);
    vec4 part[4] = vec4[4](
        texelFetch(part0, xy, 0), texelFetch(part1, xy, 0), texelFetch(part2, xy, 0), texelFetch(part3, xy, 0)
    );
    float a = float(stored.a) / 255.0;
    float place = place_of(xy.y * width + xy.x, v_depth);
    int cell = int(place);
    float t = place - float(cell);
    // The mean absorbance of the fragment's own cell, and of the one in front of it.
    float own = part[3][3];
    float front = own;
    for (int level = 0; level < LEVELS; ++level) {
        int at = (1 << level) - 1 + (cell >> (LEVELS - level));
        own -= ((cell >> (LEVELS - 1 - level) & 1) == 0 ? 1.0 : -1.0) * part[at >> 2][at & 3];
        int before = max(cell - 1, 0);
        at = (1 << level) - 1 + (before >> (LEVELS - level));
        front -= ((before >> (LEVELS - 1 - level) & 1) == 0 ? 1.0 : -1.0) * part[at >> 2][at & 3];
    }
    if (cell == 0) front = 0.0;
    own -= optical_depth(a) * (1.0 - t);  // a surface does not hide itself
    float weight = a * exp(-clamp(mix(front, own, t), 0.0, MAX_EXPONENT));
    vec3 root = vec3(stored.rgb) / 255.0;
    colours = vec4(weight * root * root, weight);
}
