// What the bundle's network reads of a pixel: n, sums of the gather pass, depth range, nearest fragment, background, and
// with BINS what is kept of its depth bins.
#include "bundle/predict.glsl"
#if BINS
#include "common/depth_bins.glsl"
layout(std430, binding = 7) readonly buffer DepthBins { uint kept[]; };  // [P, WORDS]
#endif
layout(std430, binding = 6) readonly buffer Counts { uint count[]; };

layout(std430, binding = 1) readonly buffer Nearest { uint z_min[]; };
layout(std430, binding = 2) readonly buffer Farthest { uint z_max[]; };
layout(std430, binding = 3) readonly buffer NearestColour { uint nearest_colour[]; };
layout(binding = 0) uniform sampler2D sums[5];  // units 0..4; a compiler may drop those the bundle does not read
layout(binding = 5) uniform sampler2D background;
uniform int width;

void read_features(int p, out float x[DIAPHANE_FEATURES]) {
    ivec2 xy = ivec2(p % width, p / width);
    uint word = nearest_colour[p];
    vec4 s[TEXELS];
    s[0] = texelFetch(sums[0], xy, 0);
    s[1] = texelFetch(sums[1], xy, 0);
    s[2] = texelFetch(sums[2], xy, 0);
    s[3] = vec4(texelFetch(sums[3], xy, 0).rgb, uintBitsToFloat(z_min[p]));
    s[4] = vec4(texelFetch(sums[4], xy, 0).rgb, uintBitsToFloat(z_max[p]));
    s[5] = vec4(word & 255u, word >> 8 & 255u, word >> 16 & 255u, word >> 24) / 255.0;
    s[6] = vec4(texelFetch(background, xy, 0).rgb, 0.0);
    s[0].x = float(count[p]);
    for (int i = 7; i < TEXELS; ++i) s[i] = vec4(0.0);
#if BINS
    uint at = WORDS * uint(p);
    s[0].w = uintBitsToFloat(kept[at]);
    const int every = 16 / BINS;
    for (int b = 1; b < BINS; ++b) {  // bin b here is bin `every * b` of 16
        uint share = kept[at + 1u + uint(b - 1) / 8u] >> (4u * (uint(b - 1) & 7u)) & 15u;
        int j = every * b - 1;
        s[7 + j / 4][j % 4] = float(share) / float(SHARE_LEVELS);
    }
#endif
    diaphane_features(s, x);
}
