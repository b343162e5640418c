#version 450
// The bundle's network for listed pixels, to be read back: its outputs in their order. With FEATURES_ONLY what it reads
// instead, for a runtime on the CPU.
layout(local_size_x = 64) in;
#include "allocation/bins.glsl"
#include "kbuffer-deep/inputs.glsl"

layout(std430, binding = 0) readonly buffer Pixels { uint pixel[]; };
#if FEATURES_ONLY
layout(std430, binding = 4) writeonly buffer Features { float feature[]; };  // [pixels, DIAPHANE_FEATURES], from `first`
#else
layout(std430, binding = 4) writeonly buffer Answers { float answer[]; };  // [pixels, OUTPUTS], from `first`
#endif
uniform int pixels;
uniform int first;

void main() {
    int i = int(gl_GlobalInvocationID.x) + first;
    if (i >= pixels) return;
    float x[DIAPHANE_FEATURES];
    read_features(int(pixel[i]), known_fragments(bins_of(pixel[i])), x);
#if FEATURES_ONLY
    for (int j = 0; j < DIAPHANE_FEATURES; ++j) feature[(i - first) * DIAPHANE_FEATURES + j] = x[j];
#else
    DiaphaneAnswer found = diaphane_predict(x);
    for (int j = 0; j < OUTPUTS; ++j) answer[(i - first) * OUTPUTS + j] = found.y[j];
#endif
}
