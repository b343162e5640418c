// Where a depth lies between the nearest and the farthest fragment of its pixel, on a logarithmic scale: -1 to 1.
#include "common/log1p.glsl"

layout(std430, binding = 1) readonly buffer Nearest { uint z_min[]; };
layout(std430, binding = 2) readonly buffer Farthest { uint z_max[]; };

float warped_depth(int p, float z) {
    float nearest = uintBitsToFloat(z_min[p]);
    float farthest = uintBitsToFloat(z_max[p]);
    // Differences first: they are exact for near depths, and a quotient of depths would not be.
    float extent = log1p((farthest - nearest) / nearest);
    return extent > 0.0 ? 2.0 * log1p((z - nearest) / nearest) / extent - 1.0 : -1.0;
}
