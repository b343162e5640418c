#version 450
// The bundle's network on the gathered sums: (a, b) of log gain(k) = a - b (k-1), for every listed pixel.
// The list holds the pixels whose k is not settled by their count alone, so the cost is linear in them.
// With FEATURES_ONLY it writes what the network reads instead, for a runtime on the CPU.
layout(local_size_x = 64) in;
#include "bundle/predict.glsl"

layout(std430, binding = 0) readonly buffer Pixels { uint pixel[]; };
layout(std430, binding = 1) readonly buffer Nearest { uint z_min[]; };
layout(std430, binding = 2) readonly buffer Farthest { uint z_max[]; };
layout(std430, binding = 3) readonly buffer NearestColour { uint nearest_colour[]; };
#if FEATURES_ONLY
layout(std430, binding = 4) writeonly buffer Features { float feature[]; };  // [pixels, DIAPHANE_FEATURES], from `first`
#else
layout(std430, binding = 4) writeonly buffer Gain { vec2 gain[]; };  // from `first`
#endif
layout(binding = 0) uniform sampler2D sums[5];  // units 0..4; a compiler may drop those the bundle does not read
layout(binding = 5) uniform sampler2D background;
uniform int width;
uniform int pixels;
uniform int first;

void main() {
    int i = int(gl_GlobalInvocationID.x) + first;
    if (i >= pixels) return;
    int p = int(pixel[i]);
    ivec2 xy = ivec2(p % width, p / width);
    uint word = nearest_colour[p];
    vec4 s[7];
    s[0] = texelFetch(sums[0], xy, 0);
    s[1] = texelFetch(sums[1], xy, 0);
    s[2] = texelFetch(sums[2], xy, 0);
    s[3] = vec4(texelFetch(sums[3], xy, 0).rgb, uintBitsToFloat(z_min[p]));
    s[4] = vec4(texelFetch(sums[4], xy, 0).rgb, uintBitsToFloat(z_max[p]));
    s[5] = vec4(word & 255u, word >> 8 & 255u, word >> 16 & 255u, word >> 24) / 255.0;
    s[6] = vec4(texelFetch(background, xy, 0).rgb, 0.0);
    float x[DIAPHANE_FEATURES];
    diaphane_features(s, x);
#if FEATURES_ONLY
    for (int j = 0; j < DIAPHANE_FEATURES; ++j) feature[(i - first) * DIAPHANE_FEATURES + j] = x[j];
#else
    gain[i - first] = diaphane_predict(x);
#endif
}
