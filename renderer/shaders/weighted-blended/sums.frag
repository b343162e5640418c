#version 450
// Colours weighted by depth and opacity, and the optical depth, by additive blending.
// EQUATION: 7..10, the weight of McGuire and Bavoil 2013 (renderer/techniques/weighted_blended.py).
layout(early_fragment_tests) in;
#include "common/surface.glsl"
#include "common/log1p.glsl"

uniform float near_depth;  // the view's clip range, metres
uniform float far_depth;
uniform float far_z;       // the |z| of the paper that far_depth stands for

layout(location = 0) out vec4 colours;  // sum w a C, sum w a
layout(location = 1) out float depth;   // sum -ln(1-a)

float depth_weight(float z) {
#if EQUATION == 10
    float d = log1p((z - near_depth) / near_depth) / log1p((far_depth - near_depth) / near_depth);
    float free = 1.0 - clamp(d, 0.0, 1.0);
    return max(1e-2, 3e3 * free * free * free);
#else
    z *= far_z / far_depth;
    float r = z / 200.0;
    r *= r;
#if EQUATION == 7
    float s = z / 5.0;
    float weight = 10.0 / (1e-5 + s * s + r * r * r);
#elif EQUATION == 8
    float s = z / 10.0;
    float weight = 10.0 / (1e-5 + s * s * s + r * r * r);
#else
    float weight = 0.03 / (1e-5 + r * r);
#endif
    return clamp(weight, 1e-2, 3e3);
#endif
}

void main() {
    uvec4 stored = stored_surface();
#if MIXED
    if (!is_transparent(stored)) discard;
#endif
    float a = float(stored.a) / 255.0;
    vec3 root = vec3(stored.rgb) / 255.0;
    float weight = a * depth_weight(v_depth) * a;  // w has a factor a, and the colour is premultiplied
    colours = vec4(weight * root * root, weight);
    depth = optical_depth(a);
}
