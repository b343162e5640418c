// Where a depth lies between the nearest and the farthest fragment of its pixel, in cells: 0 to CELLS - 1.
#include "common/log1p.glsl"

const int CELLS = 16;  // a fragment lies 15/16 of the way at most: the last cell's mean knows all steps
const int LEVELS = 4;  // rank 3: the levels 0 to 3

layout(std430, binding = 1) readonly buffer Nearest { uint z_min[]; };
layout(std430, binding = 2) readonly buffer Farthest { uint z_max[]; };

float place_of(int p, float z) {
    float nearest = uintBitsToFloat(z_min[p]);
    float extent = uintBitsToFloat(z_max[p]) - nearest;
    return extent > 0.0 ? float(CELLS - 1) * ((z - nearest) / extent) : 0.0;
}
