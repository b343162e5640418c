#version 450
// The absorbance in front of a depth as Haar coefficients, by additive blending. A fragment is a step, and has a
// coefficient other than 0 on each level where its wavelet lies around it: 2^(-level/2) l min(u, 1 - u), u its place in
// the wavelet. The factors 2^(-level/2) and 2^(level/2), of writing and of reading, cancel and are left out.
layout(early_fragment_tests) in;
#include "common/surface.glsl"
#include "wavelet/place.glsl"

uniform int width;
layout(location = 0) out float total;   // sum l
layout(location = 1) out vec4 part[4];  // of 15 wavelets, level by level, and of the constant

void main() {
    uvec4 stored = stored_surface();
#if MIXED
    if (!is_transparent(stored)) discard;
#endif
    float absorbance = optical_depth(float(stored.a) / 255.0);
    float z = place_of(int(gl_FragCoord.y) * width + int(gl_FragCoord.x), v_depth) / float(CELLS);
    for (int i = 0; i < 4; ++i) part[i] = vec4(0.0);
    for (int level = 0; level < LEVELS; ++level) {
        float u = z * float(1 << level);
        int k = int(u);
        u -= float(k);
        int at = (1 << level) - 1 + k;
        part[at >> 2][at & 3] = absorbance * min(u, 1.0 - u);
    }
    part[3][3] = absorbance * (1.0 - z);
    total = absorbance;
}
