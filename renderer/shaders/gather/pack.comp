#version 450
// What a binned tail keeps of every pixel's gathered depth bins (common/kept_bins.glsl), in their place: the means' own
// textures are free after it.
layout(local_size_x = 64) in;
#include "common/depth_bins.glsl"

layout(rgba16, binding = 0) uniform image2D bins[BINS / 4];  // units / 65535
#if MEAN_LEVELS
layout(binding = 0) uniform sampler2D means[BINS / 4];
#endif
uniform int width;
uniform int pixels;

// To the nearest step, in integers: at most 510 x 16 x 65535 + whole.
uint level(uint part, uint whole, uint levels) {
    return whole == 0u ? 0u : min((2u * levels * part + whole) / (2u * whole), levels);
}

void main() {
    int p = int(gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x) * 64 + int(gl_LocalInvocationIndex);
    if (p >= pixels) return;
    ivec2 xy = ivec2(p % width, p / width);
    uint front[BINS + 1];
    front[0] = 0u;
    for (int i = 0; i < BINS / 4; ++i) {
        uvec4 four = uvec4(imageLoad(bins[i], xy) * 65535.0 + 0.5);
        for (int j = 0; j < 4; ++j) front[4 * i + j + 1] = front[4 * i + j] + four[j];
    }
    uint total = front[BINS];
    for (int i = 0; i < BINS / 4; ++i) {
        uvec4 words = uvec4(0u);
#if MEAN_LEVELS
        uvec4 moved = uvec4(texelFetch(means[i], xy, 0) * 65535.0 + 0.5);
#endif
        for (int j = 0; j < 4; ++j) {
            int b = 4 * i + j;
            if (b == BINS - 1) {
                words[j] = min(total, 65535u);
                continue;
            }
            words[j] = level(front[b + 1], total, uint(SHARE_LEVELS)) << 8;
#if MEAN_LEVELS
            words[j] |= level(moved[j], front[b + 1] - front[b], uint(MEAN_LEVELS));
#endif
        }
        imageStore(bins[i], xy, vec4(words) / 65535.0);
    }
}
