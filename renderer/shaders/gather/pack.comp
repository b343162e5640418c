#version 450
// The gathered depth bins of every pixel, packed into words: what a binned tail reads while fragments are captured.
layout(local_size_x = 64) in;
#include "common/depth_bins.glsl"

layout(std430, binding = 0) writeonly buffer DepthBins { uint kept[]; };  // [P, WORDS]
layout(binding = 0) uniform sampler2D optical_depth;    // sum -ln(1-a)
layout(binding = 1) uniform sampler2D bins[BINS / 4];  // units / BIN_LIMIT
uniform int width;
uniform int pixels;

void main() {
    int p = int(gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x) * 64 + int(gl_LocalInvocationIndex);
    if (p >= pixels) return;
    ivec2 xy = ivec2(p % width, p / width);
    uint front[BINS + 1];
    front[0] = 0u;
    for (int i = 0; i < BINS / 4; ++i) {
        uvec4 four = uvec4(texelFetch(bins[i], xy, 0) * float(BIN_LIMIT) + 0.5);
        for (int j = 0; j < 4; ++j) front[4 * i + j + 1] = front[4 * i + j] + four[j];
    }
    uint total = front[BINS];
    uint at = WORDS * uint(p);
    kept[at] = floatBitsToUint(texelFetch(optical_depth, xy, 0).r);
    for (int w = 0; w < BINS / 8; ++w) {
        uint word = 0u;
        for (int j = 0; j < 8; ++j) {
            int b = 8 * w + j + 1;
            if (b == BINS || total == 0u) break;
            // To the nearest step, in integers: at most 30 x 16 x 65535 + total.
            word |= (2u * uint(SHARE_LEVELS) * front[b] + total) / (2u * total) << uint(4 * j);
        }
        kept[at + 1u + uint(w)] = word;
    }
}
